"""From the frames of a chroma meter to readings: which values may be used, and how uncertain they are."""

import math
from typing import NamedTuple

from drivers.cl200.codec import Command, Complaint, Frame, Number, complaint_of, decode_block, long_data
from drivers.cl200.options import ChromaMeterOptions, Head
from drivers.exchange import Span
from labdaq.clock import ClockState
from labdaq.reading import Flag, Instrument, Reading
from labdaq.units import Quantity, Unit


class Answer(NamedTuple):
    """A frame that a head sent, the question and the answer as bytes, and whether it had to be asked for again."""

    frame: Frame
    sent: bytes
    raw: bytes
    retried: bool


class Taken(NamedTuple):
    """When a measurement was made, how good that clock was, and who made it."""

    when: Span
    clock: ClockState
    instrument: Instrument


def instrument_of(name: str, port: str, options: ChromaMeterOptions, head: Head) -> Instrument:
    """Return who a head is: body and head as declared."""
    return Instrument(
        name=name,
        model=options.model,
        serial="/".join(filter(None, (options.serial, head.serial))),
        firmware=options.firmware,
        port=port,
        calibration=head.calibration,
    )


def values_of(frame: Frame) -> tuple[Number | None, Number | None, Number | None]:
    """Return what may be used of a reply; raises `FrameError`.

    Where the status voids values, nobody knows what stands in their place: it is not looked at.
    """
    complaint = complaint_of(frame)
    if void_flags(complaint) or complaint in {Complaint.HEAD_POWER, Complaint.EEPROM}:
        return None, None, None
    if complaint is Complaint.NO_COLOUR_TEMPERATURE and frame.command is Command.EV_TCP_DUV:
        return decode_block(frame.data[:6]), None, None
    return long_data(frame)


def void_flags(complaint: Complaint | None) -> tuple[Flag, ...]:
    """Flags of values that must not be used; empty when they may."""
    if complaint is Complaint.BATTERY:
        return (Flag.LOW_BATTERY,)
    if complaint in {Complaint.TOO_BRIGHT, Complaint.OUT_OF_RANGE}:
        return (Flag.OVER_RANGE,)
    if complaint is Complaint.RANGE_UNKNOWN:
        return (Flag.MISSING,)
    return ()


def colour_readings(options: ChromaMeterOptions, head: Head, answer: Answer, taken: Taken) -> list[Reading]:
    """Make illuminance [lx] and chromaticity x, y of a reply to 02; uncertainties as in `ChromaMeter.measure`."""
    complaint = complaint_of(answer.frame)
    low = complaint is Complaint.LOW_LIGHT
    lux, x, y = values_of(answer.frame)
    flags = void_flags(complaint) + ((Flag.RETRIED,) if answer.retried else ())
    colour_flags = flags + ((Flag.LOW_LIGHT,) if low else ())
    u_lux = None
    if lux is not None:
        u_lux = (options.limit_relative * abs(lux.value) + options.limit_digits * lux.digit) / math.sqrt(3)
    u_xy = None if low else options.limit_xy / math.sqrt(3)
    return [
        _reading(head.channel, Quantity.ILLUMINANCE, Unit.LUX, lux, u_lux, flags, answer, taken),
        _reading(f"{head.channel}.x", Quantity.CHROMATICITY_X, Unit.ONE, x, u_xy, colour_flags, answer, taken),
        _reading(f"{head.channel}.y", Quantity.CHROMATICITY_Y, Unit.ONE, y, u_xy, colour_flags, answer, taken),
    ]


def temperature_reading(head: Head, answer: Answer, taken: Taken) -> Reading:
    """Make the correlated colour temperature [K] of a reply to 08; the maker gives no accuracy for it."""
    complaint = complaint_of(answer.frame)
    flags = void_flags(complaint)
    if complaint is Complaint.LOW_LIGHT:
        flags += (Flag.LOW_LIGHT,)
    if answer.retried:
        flags += (Flag.RETRIED,)
    kelvin = values_of(answer.frame)[1]
    return _reading(f"{head.channel}.tcp", Quantity.COLOUR_TEMPERATURE, Unit.KELVIN, kelvin, None, flags, answer, taken)


def _reading(
    channel: str,
    quantity: Quantity,
    unit: Unit,
    number: Number | None,
    uncertainty: float | None,
    flags: tuple[Flag, ...],
    answer: Answer,
    taken: Taken,
) -> Reading:
    if number is None and not void_flags(complaint_of(answer.frame)):
        flags = (Flag.MISSING, *flags)  # the head sent blanks, or could not compute it
    return Reading(
        channel=channel,
        quantity=quantity,
        value=None if number is None else number.value,
        unit=unit,
        uncertainty=None if number is None else uncertainty,
        utc_ns=taken.when.utc_ns,
        mono_ns=taken.when.mono_ns,
        duration_s=taken.when.duration_s,
        clock=taken.clock,
        instrument=taken.instrument,
        flags=flags,
        raw=answer.raw.hex(),
    )
