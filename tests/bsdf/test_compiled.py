"""The cache of compiled code must not outlive the code it was made of."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def run(folder: Path) -> str:
    environment = os.environ | {"PYTHONPATH": f"{folder}:{ROOT}", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", "import outer; print(outer.twice(1.0), outer.twice.stats.cache_hits)"]
    return subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=True).stdout


def test_a_change_in_a_called_function_is_seen(tmp_path: Path) -> None:
    head = "from analysis.bsdf.compiled import compiled\n"
    (tmp_path / "inner.py").write_text(f"{head}\n@compiled\ndef once(x):\n    return x + 1.0\n")
    (tmp_path / "outer.py").write_text(
        f"{head}from inner import once\n\n@compiled\ndef twice(x):\n    return once(once(x))\n"
    )
    first = run(tmp_path).split()
    assert first[0] == "3.0"
    second = run(tmp_path).split()
    assert second[0] == "3.0"
    assert "(float64,): 1" in " ".join(second)  # from the cache
    (tmp_path / "inner.py").write_text(f"{head}\n@compiled\ndef once(x):\n    return x + 10.0\n")
    assert run(tmp_path).split()[0] == "21.0"
