"""After a release: listen until everything that came of it has been announced."""

from collections.abc import Set
from dataclasses import dataclass

from drivers.camera.codes import EventCode
from drivers.camera.link import Event
from drivers.camera.session import Session
from labdaq.clock import NS, Clock


@dataclass(frozen=True, slots=True)
class Waits:
    """How long to listen [s].

    Attributes
    ----------
    exposure_s
        Length of the exposure.
    first_s
        For the first picture, after the exposure.
    grace_s
        For further ones, after the camera said that the capture is complete.
    quiet_s
        For further ones after the last, when it says no such thing.
    """

    exposure_s: float
    first_s: float
    grace_s: float
    quiet_s: float


@dataclass(frozen=True, slots=True)
class Capture:
    """When a capture began and ended on the monotonic clock [ns], what it announced, and whether the card was full."""

    began_ns: int
    ended_ns: int
    handles: tuple[int, ...]
    full: bool


@dataclass(frozen=True, slots=True)
class Release:
    """A release: when [ns, monotonic], by which transaction (0: unknown), and how long its pictures are waited for."""

    began_ns: int
    transaction: int
    waits: Waits


async def listen(session: Session, clock: Clock, release: Release, before: Set[int]) -> Capture:
    """Collect the handles of new objects, in any order with the word that the capture is complete.

    ``before`` are the objects that were there: words about them are late ones. Raises what the session raises.
    """
    began_ns, waits = release.began_ns, release.waits
    exposed_ns = began_ns + round(waits.exposure_s * NS)
    deadline_ns = exposed_ns + round(waits.first_s * NS)
    ended_ns: int | None = None
    handles: dict[int, None] = {}
    complete = full = False
    while (left_ns := deadline_ns - clock.mono_ns()) > 0:
        event = await session.next_event(left_ns / NS)
        if event is None:
            break
        if event.code == EventCode.OBJECT_ADDED and event.parameters and event.parameters[0] not in before:
            handles[event.parameters[0]] = None
        elif event.code == EventCode.CAPTURE_COMPLETE and not _of_an_earlier_capture(event, release):
            complete = True
        elif event.code == EventCode.STORE_FULL:
            full = True  # perhaps a late word too: it counts only if no picture comes
        else:
            continue
        now_ns = clock.mono_ns()
        ended_ns = ended_ns or now_ns
        further_ns = round((waits.grace_s if complete else waits.quiet_s) * NS)
        if handles:
            deadline_ns = now_ns + further_ns
        else:
            deadline_ns = min(deadline_ns, max(now_ns, exposed_ns) + further_ns + round(waits.quiet_s * NS))
    return Capture(began_ns, ended_ns or clock.mono_ns(), tuple(handles), full)


def _of_an_earlier_capture(event: Event, release: Release) -> bool:
    """Whether a word of completion names an earlier transaction; some cameras name none."""
    number = event.parameters[0] if event.parameters else event.transaction
    return 0 < number < release.transaction
