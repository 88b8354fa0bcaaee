"""A case from recorded sessions and what a simulation predicts for each of them.

::

    item = SimulatedSession(session=Session.open(path), predicted=Predicted(sun=sun_part, sky=sky_part))
    case_from_sessions([item], simulation=Simulation(engine="our tracer", field="near")).write("cases/T18")

Readings go into the case as they were taken: each at its own time, not normalised to the daylight of one moment,
because that is one of the things an explanation looks at.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from analysis.cases.model import FORMAT, Aperture, CaseFile, Floats, Ints, Records, Simulation, System
from analysis.compare.draft import Draft
from analysis.compare.named_systems import NAMED_SYSTEMS
from analysis.compare.predicted import stems_of
from analysis.compare.session_facts import certified, test_facts, test_names
from analysis.compare.simulated_session import OtherChannel, SimulatedSession, SimulatedVariant
from labdaq.errors import DataError, Problems
from labdaq.reading import Reading
from labdaq.session import Session
from labdaq.station import Station

_FULL_SCALE_V: Final = 10.0  # of the analog modules, see `labdaq.station.Arm`
_KINDS: Final = {"illuminance": "illuminance-meter", "luminance": "luminance-meter"}


@dataclass(frozen=True, kw_only=True)
class NoiseOfHeads:
    """Standard uncertainty of the noise of one reading of the arm's heads; calibration is no noise.

    Attributes
    ----------
    relative
        Share of the reading: flicker of the amplifier, jitter of the arm.
    volts
        Noise of the converter and its line [V]; becomes lx by the heads' sensitivity.
    """

    relative: float = 0.003
    volts: float = 0.0005


def case_from_sessions(
    items: Sequence[SimulatedSession],
    *,
    title: str = "",
    simulation: Simulation | None = None,
    systems: Iterable[System] = (),
    noise: NoiseOfHeads | None = None,
) -> Draft:
    """Put sessions of one station beside their predictions.

    Site, room and goniometer are those of the sessions' headers; a test's sun follows from site and time, its
    illuminances are the means of the roof's readings during the scan. Readings are multiplied by the factor of the
    certificate in force; intensity is illuminance times the squared distance.

    Parameters
    ----------
    items
        At least one; when several have the same test, the later ones are called ``T18-2``, ``T18-3``.
    simulation
        How the predictions were made.
    systems
        What hung in the roof, by id; without it, the report's ``top``, ``box`` and ``tube`` are described by name.
    noise
        Of the arm's readings.

    Raises
    ------
    DataError
        A session has no usable reading of the arm, stations differ in what the case says once, or a prediction does
        not cover the directions that were read.
    """
    if not items:
        raise DataError("there is no session to compare")
    noise = noise or NoiseOfHeads()
    names = test_names([(item.test or item.session.header.test) for item in items])
    station = _one_station(items)
    table = _Table(station, noise)
    tests: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    variants = _Variants()
    stems = stems_of(names)
    known = {s.id: s for s in systems}
    for k, (item, name) in enumerate(zip(items, names, strict=True)):
        table.take(k, item)
        facts = test_facts(item.session, station)
        system = known.get(facts["system"]) or NAMED_SYSTEMS.get(facts["system"])
        issued = facts["start"].date().isoformat()
        aperture = system.aperture if system else None
        files |= item.predicted.files(stems[name], name, aperture=aperture, issued=issued)
        tests.append({"id": name, **facts, "simulated": item.predicted.names(stems[name])})
        if system is not None:
            known.setdefault(system.id, system)
        files |= variants.take(item.variants, name, stems[name], aperture, issued)
    hung = [known[i] for i in dict.fromkeys(t["system"] for t in tests) if i in known]
    setup = {
        "format": FORMAT,
        "title": title,
        **_place(station, items[0].session),
        **({} if simulation is None else {"simulation": simulation.model_dump(exclude_unset=True)}),
        "system": [system.model_dump(exclude_unset=True) for system in hung],
        "channel": table.channels,
        "test": tests,
        **({"variant": variants.tables} if variants.tables else {}),
    }
    return Draft(CaseFile.model_validate(setup), table.records(), files, tuple(table.notes))


def _place(station: Station, session: Session) -> dict[str, Any]:
    """Site, room and goniometer as a case has them."""
    arm = station.goniometer
    return {
        "site": station.site.model_dump(),
        "room": {"size_m": station.room.size_m},
        "goniometer": {
            "distance_m": arm.distance_m,
            "gammas_deg": arm.gammas_deg,
            "c_planes_deg": session.script.scan.c_planes_deg,
            "sensor_half_angle_deg": arm.sensor_half_angle_deg,
        },
    }


def _one_station(items: Sequence[SimulatedSession]) -> Station:
    """The station of all sessions; what a case says once must be the same in all of them."""
    first, *rest = (item.session for item in items)
    station = first.station
    problems = Problems("the sessions")
    for session in rest:
        other = session.station
        for name in ("site", "room", "goniometer"):
            if getattr(other, name) != getattr(station, name):
                problems.add(session.path.name, f"its {name} differs from that of {first.path.name}")
    problems.raise_if_any(DataError, "make a case of each station, or of each arrangement")
    return station


class _Variants:
    """Collects variants over the sessions: one table for each mechanism and setting."""

    def __init__(self) -> None:
        self.tables: list[dict[str, Any]] = []

    def take(
        self, several: Sequence[SimulatedVariant], test: str, stem: str, aperture: Aperture | None, issued: str
    ) -> dict[str, bytes]:
        """Note the variants of a test; return their files."""
        files: dict[str, bytes] = {}
        for variant in several:
            wanted = {"mechanism": variant.mechanism, "setting": dict(variant.setting)}
            same = [i for i, table in enumerate(self.tables) if {key: table[key] for key in wanted} == wanted]
            if not same:
                self.tables.append({**wanted, "simulated": {}})
            k = same[0] if same else len(self.tables) - 1
            group = f"variant-{k + 1}"
            self.tables[k]["simulated"][test] = variant.predicted.names(stem, group)
            files |= variant.predicted.files(stem, test, group=group, aperture=aperture, issued=issued)
        return files


class _Table:
    """Collects channels and records over the sessions."""

    def __init__(self, station: Station, noise: NoiseOfHeads) -> None:
        self.arm = station.goniometer
        self.noise = noise
        self.channels: list[dict[str, Any]] = []
        self.notes: list[str] = []
        self._pieces: list[tuple[Ints | Floats, ...]] = []

    def take(self, test: int, item: SimulatedSession) -> None:
        """Add the readings of one session."""
        session = item.session
        heads = [c for c in session.channels if c in self.arm.channels]
        if not heads:
            raise DataError(
                f"{session.path}: holds no reading of the goniophotometer ({', '.join(self.arm.channels[:2])} ...)"
            )
        for channel in heads:
            self._take_head(test, item, channel)
        for channel, other in item.others.items():
            self._take_other(test, item, channel, other)

    def _take_head(self, test: int, item: SimulatedSession, channel: str) -> None:
        readings = item.session.readings(channel)
        gamma, c = readings.at("gamma_deg"), readings.at("c_deg")
        if not (np.isfinite(gamma).all() and np.isfinite(c).all()):
            raise DataError(f"{item.session.path}: a reading of {channel} does not say where the sensor was")
        factor = certified(item.session, readings[0].instrument) * self.arm.distance_m**2
        measured = readings.value * factor
        sensitivity = self.arm.sensitivities_v_per_lx[self.arm.channels.index(channel)]
        floor = self.noise.volts / sensitivity * factor
        uncertainty = np.hypot(self.noise.relative * measured, floor)
        total, sun, sky = item.predicted.at(gamma, c)
        where = self._channel(
            channel, "goniometer", "luminous_intensity", "cd", range_max=_FULL_SCALE_V / sensitivity * factor
        )
        self._add(test, where, readings.utc_ns, gamma, c, measured, uncertainty, total, sun, sky)
        self._note(item, channel, measured)

    def _take_other(self, test: int, item: SimulatedSession, channel: str, other: OtherChannel) -> None:
        readings = item.session.readings(channel)
        if not len(readings):
            raise DataError(f"{item.session.path}: holds no reading of {channel}, for which there is a prediction")
        first: Reading = readings[0]
        if str(first.quantity) not in _KINDS:
            raise DataError(f"{item.session.path}: {channel} is a {first.quantity}, which a case does not hold")
        measured = readings.value * certified(item.session, first.instrument)
        uncertainty = other.noise_relative * np.abs(measured)
        predicted = np.asarray(other.predict(readings.utc_ns), dtype=np.float64)
        unknown = np.full(len(readings), np.nan)
        where = self._channel(channel, _KINDS[str(first.quantity)], str(first.quantity), str(first.unit))
        gamma, c = readings.at("gamma_deg"), readings.at("c_deg")
        self._add(test, where, readings.utc_ns, gamma, c, measured, uncertainty, predicted, unknown, unknown)
        self._note(item, channel, measured)

    def _channel(self, name: str, kind: str, quantity: str, unit: str, **more: float) -> int:
        made = {"id": name, "kind": kind, "quantity": quantity, "unit": unit, **more}
        for k, known in enumerate(self.channels):
            if known["id"] == name:
                return k
        self.channels.append(made)
        return len(self.channels) - 1

    def _add(self, test: int, channel: int, utc_ns: Ints, *columns: Floats) -> None:
        n = len(utc_ns)
        of_test, of_channel = np.full(n, test, dtype=np.int64), np.full(n, channel, dtype=np.int64)
        self._pieces.append((of_test, of_channel, utc_ns, *columns))

    def _note(self, item: SimulatedSession, channel: str, measured: Floats) -> None:
        missing = int(np.count_nonzero(np.isnan(measured)))
        if missing:
            self.notes.append(
                f"{item.session.path.name}: {missing} readings of {channel} must not be used and are empty"
            )

    def records(self) -> Records:
        """All records, those of a test in the order of time."""
        columns = [np.concatenate(column) for column in zip(*self._pieces, strict=True)]
        order = np.lexsort((columns[1], columns[2], columns[0]))
        return Records(*(column[order] for column in columns))
