"""The 32 tests of the Greenwood campaign of July 2010: when, under which sky, with which illuminances.

Facts from the campaign's report, tables 3 and 5: start and end (UTC), system, sky, global and diffuse illuminance in
footcandles. The twelve validation tests of its chapter 8 are named.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Final

from labdaq.clock import utc_ns_of
from labdaq.units import LUX_PER_FOOTCANDLE
from simulators.hidden.light import Site

SITE: Final = Site(34.2176, -82.1084, 180.0)
VALIDATION: Final = (6, 9, 11, 15, 16, 18, 22, 24, 25, 28, 30, 32)

_TABLE: Final = """
 1 21 14:15:00 14:18:45 tube clear           6937.7  1853.3
 2 21 14:33:00 14:36:48 tube clear           7549.8  1857.2
 3 21 16:03:00 16:06:25 box  clear           9758.0  2151.8
 4 21 16:13:00 16:15:35 tube clear           9912.0  2217.8
 5 21 16:22:00 16:24:32 tube clear          10048.0  2267.4
 6 21 18:07:00 18:09:25 tube partly-cloudy  11084.0  3270.2
 7 21 18:13:00 18:15:33 tube partly-cloudy  10910.0  2891.8
 8 21 18:23:00 18:25:28 box  partly-cloudy  10972.0  2912.2
 9 21 18:29:00 18:31:22 box  partly-cloudy  10944.0  3128.0
10 21 19:09:00 19:11:18 top  partly-cloudy  10566.0  3093.4
11 21 19:16:00 19:19:17 top  partly-cloudy  10030.0  3012.2
12 21 19:28:00 19:30:13 top  partly-cloudy   9768.0  2919.8
13 21 20:04:00 20:06:03 top  partly-cloudy   3328.4  2822.0
14 22 12:39:00 12:42:25 top  clear           3074.4  1342.2
15 22 12:45:00 12:47:52 top  clear           3408.4  1368.4
16 22 12:54:00 12:57:18 tube clear           3334.8  1433.4
17 22 13:00:00 13:03:01 tube clear           3577.2  1491.4
18 22 13:12:00 13:14:45 box  clear           4247.2  1611.2
19 22 13:17:00 13:19:48 box  clear           4636.4  1669.2
20 22 14:20:00 14:22:53 box  clear           7193.8  1665.2
21 22 14:26:00 14:28:50 box  clear           7295.0  1684.2
22 22 14:42:00 14:44:44 box  clear           7831.4  1670.0
23 22 14:51:00 14:53:41 tube clear           8053.8  1700.2
24 22 14:57:00 14:59:42 tube clear           8254.6  1710.4
25 22 15:07:00 15:09:51 top  clear           8582.8  1745.4
26 22 15:12:00 15:15:03 top  clear           8733.4  1781.4
27 22 16:06:00 16:08:15 top  clear          10672.0  2665.2
28 22 16:11:00 16:13:07 top  clear          11000.0  3032.2
29 22 16:17:00 16:19:07 tube clear          11028.0  3133.2
30 22 16:22:00 16:24:02 tube clear          10900.0  3349.8
31 22 16:34:00 16:36:23 box  clear          10018.0  3615.2
32 22 16:39:00 16:41:08 box  clear           9240.0  3640.0
"""


@dataclass(frozen=True)
class RealTest:
    """One test of the campaign; times in UTC [ns], illuminances in lx."""

    number: int
    start_ns: int
    end_ns: int
    system: str
    sky: str
    global_lx: float
    diffuse_lx: float


def _parsed() -> dict[int, RealTest]:
    tests = {}
    for line in _TABLE.strip().splitlines():
        number, day, start, end, system, sky, total, diffuse = line.split()
        tests[int(number)] = RealTest(
            int(number),
            utc_ns_of(datetime.fromisoformat(f"2010-07-{day}T{start}+00:00")),
            utc_ns_of(datetime.fromisoformat(f"2010-07-{day}T{end}+00:00")),
            system,
            sky,
            float(total) * LUX_PER_FOOTCANDLE,
            float(diffuse) * LUX_PER_FOOTCANDLE,
        )
    return tests


TESTS: Final = _parsed()
