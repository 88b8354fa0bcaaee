"""The demo's folder: where everything is, and whose folder it may take over."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from labdaq.errors import StorageError
from labdaq.whole_file import write_whole_bytes

MARK: Final = "labdaq-demo.json"
FORMAT: Final = "labdaq-demo/1"


@dataclass(frozen=True)
class Folder:
    """Places in the demo's folder."""

    home: Path

    @property
    def sessions(self) -> Path:
        """Sessions of the tests."""
        return self.home / "sessions"

    @property
    def case(self) -> Path:
        """Recordings beside predictions."""
        return self.home / "case"

    @property
    def answer(self) -> Path:
        """What the explanation wrote."""
        return self.home / "answer"

    @property
    def truth(self) -> Path:
        """What is concealed; only the last step opens it."""
        return self.home / "concealed" / "truth.json"

    def note(self, facts: dict[str, Any]) -> None:
        """Write the folder's mark with facts about the run."""
        text = msgspec.json.format(msgspec.json.encode({"format": FORMAT, **facts}), indent=2)
        write_whole_bytes(self.home / MARK, text + b"\n")


def claim(home: Path) -> Folder:
    """Take a folder for the demo: a new one, an empty one, or a former demo's, which is emptied.

    Raises `StorageError` for a folder that holds anything else, and where the disk refuses.
    """
    home = home.absolute()
    try:
        if home.exists() and not home.is_dir():
            raise StorageError(f"{home}: is a file", "give another folder with --out")
        if home.is_dir() and any(home.iterdir()) and not (home / MARK).is_file():
            raise StorageError(
                f"{home}: is not empty, and no former demo's folder (it has no {MARK})",
                "give another folder with --out",
            )
        if home.is_dir():
            for path in home.iterdir():
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
                elif path.name != MARK:
                    path.unlink()
        home.mkdir(parents=True, exist_ok=True)
        folder = Folder(home)
        folder.note({"state": "running"})
        folder.truth.parent.mkdir()
    except OSError as error:
        raise StorageError(f"{home}: cannot be made: {error.strerror}", "give another folder with --out") from error
    return folder
