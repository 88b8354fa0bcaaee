"""Make sure that ``drivers``, ``simulators`` and ``analysis`` are ours.

The packages have plain names, as the laboratory has rooms. If another module of the same name comes first on the
import path (a folder ``analysis`` beside the script, say), Python would silently import that one.
"""

from importlib.util import find_spec
from pathlib import Path

from labdaq.errors import LabdaqError

ROOMS = ("drivers", "simulators", "analysis")


def check_rooms(home: Path | None = None) -> None:
    """Raise `LabdaqError` naming the module that shadows one of our packages.

    ``home`` is the folder our packages are installed in; by default the one ``labdaq`` itself was found in.
    """
    home = (home or Path(__file__).parent.parent).resolve()
    for room in ROOMS:
        spec = find_spec(room)
        origin = spec.origin if spec else None
        if origin is None or Path(origin).resolve().parent.parent != home:
            found = origin or "a folder without __init__.py, or nothing"
            raise LabdaqError(
                f"the package '{room}' of labdaq (in {home}) is hidden by another one: {found}",
                "run from another folder, or rename that module, or remove it from PYTHONPATH",
            )
