"""The check in tests/conftest.py finds what it is there for."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

LEAKS = """
import asyncio, os, socket, threading

keep = []

def test_task():
    async def main():
        asyncio.create_task(asyncio.sleep(10))
    asyncio.run(main())

def test_socket():
    keep.append(socket.socket())

def test_terminal():
    keep.append(os.openpty())

def test_file(tmp_path):
    keep.append((tmp_path / "x").open("w"))

def test_loop():
    keep.append(asyncio.new_event_loop())

def test_clean(tmp_path):
    async def main():
        await asyncio.create_task(asyncio.sleep(0))
    asyncio.run(main())
    (tmp_path / "x").write_text("closed again")

def test_a_library_s_own_thread():
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, daemon=True).start()
    keep.append(loop)
"""


def test_what_tests_leave_behind_is_found(tmp_path: Path) -> None:
    shutil.copy(Path(__file__).parents[1] / "conftest.py", tmp_path)
    (tmp_path / "test_leaks.py").write_text(LEAKS)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)]
    alone = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=alone, capture_output=True, text=True, check=False)
    told = [line.split(" ")[1].rpartition("::")[2] for line in done.stdout.splitlines() if line.startswith("ERROR ")]
    assert told == ["test_task", "test_socket", "test_terminal", "test_file", "test_loop"]
    assert "7 passed, 5 errors" in done.stdout
