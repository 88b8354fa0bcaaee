"""All instruments at once: they observe one world at one time, on real ports and in virtual time."""

import asyncio
import math
import struct

import numpy as np
import pytest
import usb.core
import usb.util
from emulator_helpers import MORNING_NS, UniformWorld, in_virtual_time, silence

from labdaq.clock import NS, ScaledClock, VirtualClock
from labdaq.pipe import PipeEnd
from simulators.cl200 import ChromaMeterOptions, Head, LevelHead
from simulators.cl200.frames import frame
from simulators.goniophotometer.rtu import rtu_frame
from simulators.line import Drop
from simulators.ls110 import LuminanceMeterOptions
from simulators.options import INSTRUMENTS, EmulationOptions, LineTrouble
from simulators.station import EmulatedStation
from simulators.world.emulated import EmulatedWorld, WorldOptions


async def zenith(end: PipeEnd) -> float:
    end.write(b"MES\r\n")
    reply = await end.reader.readuntil(b"\r\n")
    assert reply.startswith(b"OK00,CcPH")
    return float(reply[9:15])


async def illuminance(end: PipeEnd, clock: VirtualClock) -> float:
    async def ask(body: str) -> str:
        end.write(frame(body))
        return (await end.reader.readuntil(b"\r\n"))[1:-5].decode()

    await ask("00541   ")
    await clock.sleep(0.5)
    end.write(frame("99551  0"))
    await clock.sleep(0.5)
    await ask("004010  ")
    await clock.sleep(0.5)
    end.write(frame("994021  "))
    await clock.sleep(0.5)
    reply = await ask("00021200")
    assert reply[6] in "1234"
    return int(reply[9:13]) * 10.0 ** (int(reply[13]) - 4)


async def heads(end: PipeEnd) -> np.ndarray:
    """Lux of the first eight heads."""
    end.write(rtu_frame(2, b"\x04\x00\x00\x00\x08"))
    reply = await end.reader.readexactly(21)
    return np.array(struct.unpack(">8h", reply[3:-2])) / 32767 * 10.0 / 3e-4


def test_all_instruments_see_the_same_world_at_the_same_instant() -> None:
    world = EmulatedWorld(WorldOptions(effort=0.02))

    async def main(clock: VirtualClock) -> None:
        async with EmulatedStation(world, clock, EmulationOptions(seed=4), in_memory=True) as station:
            assert list(station.endpoints) == list(INSTRUMENTS)
            assert station.endpoints["ls110"] == "memory:ls110"
            seen = await asyncio.gather(
                zenith(station.dial("ls110")),
                illuminance(station.dial("cl200_global"), clock),
                illuminance(station.dial("cl200_diffuse"), clock),
            )
            await clock.sleep(1.0)
            lux = await heads(station.dial("goniophotometer_rtu"))
            now = clock.utc_ns()
            up = np.array([0.0, 0.0, 1.0])
            assert seen[0] == pytest.approx(float(world.sky_luminance(up, now)), rel=0.006)
            assert seen[1] == pytest.approx(world.roof_illuminance(up, now), rel=0.012)
            assert seen[2] == pytest.approx(world.roof_illuminance(up, now, 5.0), rel=0.012)
            gammas = np.array([0.0, 5, 15, 25, 35, 45, 55, 65])
            assert lux == pytest.approx(
                world.room_illuminance(gammas, 37.4, now), abs=0.6, rel=1e-3
            )  # half a step of 1 lx, and noise

    in_virtual_time(main)


def test_virtual_time_costs_nothing_and_repeats_exactly() -> None:
    async def main(clock: VirtualClock) -> list[float]:
        async with EmulatedStation(UniformWorld(), clock, EmulationOptions(seed=9), in_memory=True) as station:
            meter = station.dial("ls110")
            values = [await zenith(meter) for _ in range(100)]
        return [*values, clock.mono_ns() / NS]

    first, again = in_virtual_time(main), in_virtual_time(main)
    assert first == again
    assert first[-1] > 80.0


def test_the_two_chroma_meters_have_noises_of_their_own() -> None:
    async def main(clock: VirtualClock) -> list[float]:
        same = ChromaMeterOptions(heads=(Head(0),))
        options = EmulationOptions(cl200_global=same, cl200_diffuse=same)
        async with EmulatedStation(UniformWorld(), clock, options, in_memory=True) as station:
            return [float(meter.read(0).xyz[1]) for meter in (station.cl200_global, station.cl200_diffuse)]

    one, other = in_virtual_time(main)
    assert one != other


def test_hooks_reach_the_instruments() -> None:
    options = EmulationOptions(
        ls110=LuminanceMeterOptions(repeatability=0.0, response=lambda luminance, sun, angle: 1.1 * luminance),
        cl200_global=ChromaMeterOptions(repeatability=0.0, heads=(Head(0, LevelHead(gain=0.9)),)),
    )

    async def main(clock: VirtualClock) -> tuple[float, float]:
        async with EmulatedStation(UniformWorld(), clock, options, in_memory=True) as station:
            return await zenith(station.dial("ls110")), await illuminance(station.dial("cl200_global"), clock)

    luminance, lux = in_virtual_time(main)
    assert luminance == 3300.0
    assert lux == pytest.approx(0.9 * 3000 * math.pi, rel=1e-3)


def test_troubles_are_there_from_the_start() -> None:
    async def main(clock: VirtualClock) -> None:
        options = EmulationOptions(troubles=(LineTrouble("ls110", Drop(), times=2, skip=1),))
        async with EmulatedStation(UniformWorld(), clock, options, in_memory=True) as station:
            end = station.dial("ls110")
            await zenith(end)
            for _ in range(2):
                end.write(b"MES\r\n")
                assert await silence(end, clock, 3.0)
            await zenith(end)
            station.line_faults["ls110"].arm(Drop(), times=None)
            end.write(b"MES\r\n")
            assert await silence(end, clock, 3.0)

    in_virtual_time(main)
    with pytest.raises(ValueError, match="no serial line"):
        LineTrouble("camera_ptpip", Drop())


def test_virtual_time_refuses_real_ports_and_real_ports_cannot_be_dialled() -> None:
    async def virtual(clock: VirtualClock) -> None:
        with pytest.raises(ValueError, match="in_memory=True"):
            EmulatedStation(UniformWorld(), clock)

    async def real() -> None:
        clock = ScaledClock(MORNING_NS, 10.0)
        async with EmulatedStation(UniformWorld(), clock, EmulationOptions(serial="tcp")) as station:
            assert all(":" in endpoint for endpoint in station.endpoints.values())
            with pytest.raises(KeyError, match="no line in memory"):
                station.dial("ls110")
            taken = int(station.endpoints["camera_ptpip"].split(":")[1])
            with pytest.raises(OSError):
                await EmulatedStation(UniformWorld(), clock, EmulationOptions(camera_port=taken)).start()
        assert station.endpoints == {}

    in_virtual_time(virtual)
    asyncio.run(real())


def test_every_instrument_answers_on_a_tcp_port() -> None:
    """Serial instruments behind a serial server: the same bytes, ten times faster."""

    async def main() -> None:
        clock = ScaledClock(MORNING_NS, 10.0)
        async with EmulatedStation(UniformWorld(), clock, EmulationOptions(serial="tcp")) as station:
            for name, request, reply in (
                ("ls110", b"CCR\r\n", b"OK00,1.000\r\n"),
                ("cl200_global", frame("00541   "), frame("0054    ")),
                ("cl200_diffuse", frame("00541   "), frame("0054    ")),
                ("goniophotometer_rtu", rtu_frame(1, b"\x03\x10\x03\x00\x01"), bytes.fromhex("01 03 02 00 32 39 91")),
                (
                    "goniophotometer_tcp",
                    bytes.fromhex("00010000000601031003 0001"),
                    bytes.fromhex("0001000000050103020032"),
                ),
            ):
                host, port = station.endpoints[name].split(":")
                reader, writer = await asyncio.open_connection(host, int(port))
                writer.write(request)
                assert await reader.readexactly(len(reply)) == reply
                writer.close()
                await writer.wait_closed()

    asyncio.run(main())


def test_the_camera_is_one_on_usb_and_on_the_network() -> None:
    async def main(clock: VirtualClock) -> None:
        async with EmulatedStation(UniformWorld(), clock, in_memory=True) as station:
            backend = station.usb()
            device = usb.core.find(backend=backend, idProduct=0x010D)
            assert device is not None
            device.write(0x02, bytes.fromhex("10000000 0100 0210 00000000 01000000"))
            assert bytes(device.read(0x81, 64)) == bytes.fromhex("0c000000 0300 0120 00000000")
            device.write(0x02, bytes.fromhex("0c000000 0100 0e10 01000000"))
            assert bytes(device.read(0x81, 64)) == bytes.fromhex("0c000000 0300 0120 01000000")
            with pytest.raises(usb.core.USBTimeoutError):
                device.read(0x83, 64, timeout=60_000)
            await clock.sleep(2.0)
            assert bytes(device.read(0x83, 64))[6:8] == bytes.fromhex("0240")
            assert len(station.camera.card.objects) == 3
            usb.util.dispose_resources(device)

    in_virtual_time(main)


def test_a_line_keeps_its_state_when_it_is_dialled_again() -> None:
    """Opening and closing a port does not switch a meter off and on."""

    async def main(clock: VirtualClock) -> None:
        async with EmulatedStation(UniformWorld(), clock, in_memory=True) as station:
            end = station.dial("cl200_global")
            await illuminance(end, clock)
            end.close()
            again = station.dial("cl200_global")
            again.write(frame("00021200"))
            assert (await again.reader.readuntil(b"\r\n"))[5:8] == b"1 3"

    in_virtual_time(main)
