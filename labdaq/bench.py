"""The instruments of one station, together: connect them all at once, close them all, whatever happens."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TypeVar

from labdaq.clock import Clock
from labdaq.errors import ConnectError, DeviceError, LabdaqError
from labdaq.instruments import Camera, ChromaMeter, Device, Goniophotometer, LuminanceMeter, place_of
from labdaq.reading import Instrument

T = TypeVar("T")


@dataclass(frozen=True)
class Bench:
    """What a test is taken with; each instrument has one owner and one task."""

    luminance: tuple[LuminanceMeter, ...]
    chroma: tuple[ChromaMeter, ...]
    camera: Camera
    goniophotometer: Goniophotometer

    @property
    def devices(self) -> tuple[Device, ...]:
        """All of them."""
        return (*self.luminance, *self.chroma, self.camera, self.goniophotometer)


async def each(devices: tuple[Device, ...], do: Callable[[Device], Awaitable[T]]) -> list[T | LabdaqError]:
    """Do something with all devices at once; return results and errors in the devices' order.

    Raises nothing but cancellation: what is not a `LabdaqError` becomes a `ConnectError` that names the instrument.
    """

    async def guarded(device: Device) -> T | LabdaqError:
        try:
            return await do(device)
        except LabdaqError as error:
            return error
        except Exception as error:
            wrapped = ConnectError(f"{type(error).__name__}: {error}", place=place_of(device))
            wrapped.__cause__ = error
            return wrapped

    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(guarded(device), name=device.identity().name) for device in devices]
    return [task.result() for task in tasks]


async def connect(device: Device, clock: Clock, limit_s: float) -> Instrument:
    """Connect one instrument; raises `ConnectError` or another `DeviceError`, at the latest after ``limit_s`` [s]."""
    try:
        async with clock.timeout(limit_s):
            await device.connect()
            return device.identity()
    except DeviceError:
        raise
    except TimeoutError as error:
        raise ConnectError(
            f"was not ready within {limit_s:g} s", place=place_of(device), hint="check power, cable and port"
        ) from error


async def connect_all(bench: Bench, clock: Clock, limit_s: float) -> tuple[Instrument, ...]:
    """Connect all instruments; raises one `DeviceError` that tells of every one that is missing."""
    found = await each(bench.devices, lambda device: connect(device, clock, limit_s))
    errors = [f for f in found if isinstance(f, LabdaqError)]
    if errors:
        raise combined(errors)
    return tuple(f for f in found if isinstance(f, Instrument))


async def close_all(bench: Bench, clock: Clock, limit_s: float = 5.0) -> None:
    """Close all instruments, each within ``limit_s`` [s]; one that cannot be closed does not keep the others open."""

    async def close(device: Device) -> None:
        with contextlib.suppress(TimeoutError):
            async with clock.timeout(limit_s):
                await device.aclose()

    await each(bench.devices, close)


def combined(errors: list[LabdaqError]) -> LabdaqError:
    """One error that says all of them."""
    first = errors[0]
    if len(errors) > 1:
        first.message, first.hint = "\n".join(str(error) for error in errors), ""
    return first


def in_step(error: LabdaqError, step: str) -> LabdaqError:
    """Let an error say in which step it happened."""
    error.message = f"{error.message}; in step {step}"
    return error
