"""The daylight of a session, as a simulation takes it: the processed sky and its sun."""

from dataclasses import dataclass
from pathlib import Path

from analysis.process.derived import PROCESS, derived, read_account
from analysis.process.roof import diffuse_channels, global_channels, meter, site_of, window_of
from analysis.process.session import SKY_MASTER
from analysis.simulate.daylight import Daylight, daylight
from analysis.sky.map import SkyMap
from analysis.sky.sun import sun_position
from labdaq.errors import DataError
from labdaq.session import Session


@dataclass(frozen=True)
class SessionDaylight:
    """A session's daylight; ``source`` is ``map`` for its processed sky, ``perez`` for a model of its illuminances."""

    daylight: Daylight
    source: str


def daylight_of(session: Session) -> SessionDaylight:
    """Sun and sky of a processed session; without a sky map, Perez' sky for the roof's mean illuminances.

    Raises `DataError` for a session that was not processed, or has neither sky map nor roof readings.
    """
    account = read_account(session.path, PROCESS)
    if account is None:
        raise DataError(f"{session.path}: is not processed", f"labdaq process {session.path}")
    test = session.header.test
    if account.get("sky"):
        sky = SkyMap.load(derived(session.path) / SKY_MASTER)
        sun, total = account["sky"]["sun"], sky.horizontal_illuminance()
        beam = max(0.0, account["sky"]["readings"]["global"]["mean"] - total)
        found = daylight(sun["altitude_deg"], sun["azimuth_deg"], total + beam, total, sky.at, test)
        return SessionDaylight(found, "map")
    return SessionDaylight(_modelled(session), "perez")


def _modelled(session: Session) -> Daylight:
    station = session.station
    window = window_of(session, station)
    total = meter(session, global_channels(station), window)
    diffuse = meter(session, diffuse_channels(station), window)
    if window is None or total is None or diffuse is None:
        raise DataError(f"{session.path}: has neither a sky map nor global and diffuse illuminances to model a sky of")
    sun = sun_position(window.middle_ns, site_of(station))
    both = max(total.mean.value, diffuse.mean.value)
    place = float(sun.altitude_deg), float(sun.azimuth_deg)
    return daylight(*place, both, diffuse.mean.value, "perez", session.header.test)


def issued(session: Session) -> str:
    """The day of a session, for photometric files made of it."""
    return session.header.started[:10]


def found_beside(path: Path) -> bool:
    """Whether a session's derived files hold a sky map."""
    return (derived(path) / SKY_MASTER).is_file()
