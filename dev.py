#!/usr/bin/env python3
"""Set up and run labdaq: the demo, the tests, the slow proofs. Needs Python 3.11 with venv, nothing else.

usage: python3 dev.py demo [options of `labdaq demo`]   set up .venv and run the main job on the emulated station
       python3 dev.py test [options of pytest]          set up .venv and run linters, type checks and tests
       python3 dev.py slow [options of pytest]          set up .venv and run the long proofs
       python3 dev.py findings PAGE DATA_DIR            set up .venv and compute the numbers of docs/findings/PAGE.md
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

HOME = Path(__file__).resolve().parent
VENV = Path(os.environ.get("LABDAQ_VENV", HOME / ".venv"))


def set_up() -> Path:
    """Make or refresh the environment; return the folder of its programs."""
    programs = VENV / "bin"
    recipe = hashlib.sha256((HOME / "pyproject.toml").read_bytes()).hexdigest()
    stamp = VENV / "labdaq-recipe"
    if stamp.is_file() and stamp.read_text() == recipe:
        return programs
    print(f"setting up {VENV} (once; some minutes)", flush=True)
    made = subprocess.run([sys.executable, "-m", "venv", str(VENV)], check=False)
    if made.returncode:
        sys.exit("this Python cannot make virtual environments; on Debian: apt install python3-venv")
    subprocess.run([programs / "pip", "install", "--quiet", "--no-compile", "--editable", f"{HOME}[dev]"], check=True)
    # on all cores, as pip would not, and without the packages' own tests; some bring files that no Python 3 can read
    for libraries in VENV.glob("lib/python3*/site-packages"):
        options = ["-qq", "-j", "0", "-x", "site-packages/.*/tests/"]
        subprocess.run([programs / "python", "-m", "compileall", *options, libraries], check=False)
    stamp.write_text(recipe)
    return programs


def run(*command: str | Path) -> None:
    """Run one command from the project's root; end with its exit code if it fails."""
    print("$", *(Path(part).name if isinstance(part, Path) else part for part in command), flush=True)
    code = subprocess.run(command, cwd=HOME, check=False).returncode
    if code:
        sys.exit(code)


def test(programs: Path, *options: str) -> None:
    """Run linters and tests; beside them, make ready what the last of the tests need (tests/conftest.py)."""
    ready = subprocess.Popen([programs / "python", "-m", "analysis.simulate.ready"], cwd=HOME)
    try:
        run(programs / "ruff", "check", ".")
        run(programs / "ruff", "format", "--check", ".")
        run(programs / "mypy")
        run(programs / "lint-imports")
        if options:  # some tests may be those that simulate, at once
            ready.wait()
        if ready.poll():
            sys.exit("python3 -m analysis.simulate.ready has failed")
        # each worker needs up to 4 GB; its matrices are small, so that threads would only wait for each other
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        run(programs / "pytest", "--numprocesses=2", "--dist=loadfile", "--no-loadscope-reorder", *options)
        if ready.wait():
            sys.exit("python3 -m analysis.simulate.ready has failed")
    finally:
        ready.kill()
        ready.wait()


def main() -> None:
    """Do what the first argument says."""
    what, *rest = sys.argv[1:] or ["help"]
    if sys.version_info < (3, 11) or what not in {"demo", "test", "slow", "findings"}:
        sys.exit(__doc__)
    programs = set_up()
    if what == "demo":
        run(programs / "labdaq", "demo", *rest)
    elif what == "findings":
        paths = [word if word.startswith("-") else str(Path(word).absolute()) for word in rest[1:]]
        run(programs / "python", "benchmarks/explain_findings.py", *rest[:1], *paths)
    elif what == "slow":
        run(programs / "pytest", "-m", "slow", *rest)
    else:
        test(programs, *rest)


main()
