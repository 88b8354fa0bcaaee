"""The 32 tests of the Greenwood report, as an emulated station takes them again.

Times, skylights and skies are those of the report's Table 3 (21 and 22 July 2010, Eastern Daylight Time). Its clouds
are not: a plain emulated world has none that drift, and "partly cloudy" is the Perez sky of that kind.
"""

from datetime import UTC, datetime, timedelta
from typing import Final

from simulators.world.campaign import PlannedTest, Sky, System

EDT: Final = timedelta(hours=-4)
FIRST_OF_SECOND_DAY: Final = 14

_TOP: Final = "top"
_BOX: Final = "box"
_TUBE: Final = "tube"
_PLAN: Final[tuple[tuple[int, int, System], ...]] = (
    (10, 15, _TUBE), (10, 33, _TUBE), (12, 3, _BOX), (12, 13, _TUBE), (12, 22, _TUBE), (14, 7, _TUBE), (14, 13, _TUBE),
    (14, 23, _BOX), (14, 29, _BOX), (15, 9, _TOP), (15, 16, _TOP), (15, 28, _TOP), (16, 4, _TOP), (8, 39, _TOP),
    (8, 45, _TOP), (8, 54, _TUBE), (9, 0, _TUBE), (9, 12, _BOX), (9, 17, _BOX), (10, 20, _BOX), (10, 26, _BOX),
    (10, 42, _BOX), (10, 51, _TUBE), (10, 57, _TUBE), (11, 7, _TOP), (11, 12, _TOP), (12, 6, _TOP), (12, 11, _TOP),
    (12, 17, _TUBE), (12, 22, _TUBE), (12, 34, _BOX), (12, 39, _BOX),
)  # fmt: skip
"""Hour and minute of the start, and the skylight, of tests 1 to 32."""

_PARTLY_CLOUDY: Final = range(6, 14)


def greenwood_tests() -> tuple[PlannedTest, ...]:
    """Tests ``T01`` to ``T32`` in the report's order."""
    found = []
    for number, (hour, minute, system) in enumerate(_PLAN, start=1):
        day = 22 if number >= FIRST_OF_SECOND_DAY else 21
        start = datetime(2010, 7, day, hour, minute, tzinfo=UTC) - EDT
        sky: Sky = "partly-cloudy" if number in _PARTLY_CLOUDY else "clear"
        found.append(PlannedTest(f"T{number:02d}", start, system, sky, 0.0, 2010 + number))
    return tuple(found)
