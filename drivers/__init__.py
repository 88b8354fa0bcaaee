"""Instruments on the wire. Each driver turns a real protocol into readings.

::

    transport.py        the line: bytes by their end or their number; the in-memory one
    serial_port.py      a serial port (opened by pyserial, awaited by asyncio)
    tcp.py              a TCP connection
    ports.py            from the text of a port in a station file to its line
    exchange.py         waiting for an answer; when a measurement was made; FrameError of the codecs
    ls110/              Konica Minolta LS-110 luminance meter              `LuminanceMeter.read` [cd/m²]
    cl200/              Konica Minolta CL-200 chroma meter, several heads  `ChromaMeter.measure` [lx, x, y, K]
    camera/             cameras that speak PTP, over USB or TCP            `Camera.bracket` gives photos
    goniophotometer/    motor arm and ten heads on a Modbus line           `Goniophotometer.read` [lx]
    blocking.py         all of them without asyncio, for a notebook

In each instrument's room a codec turns bytes into values and back, without waiting and without a clock; the driver
beside it owns the line and the time. A driver is made from its name, its line, a clock and its options, and is
connected, asked and closed::

    meter = LuminanceMeter("roof-luminance", line, SystemClock(), LuminanceMeterOptions(channel="sky.zenith"))
    await meter.connect()
    reading = await meter.read()
    await meter.aclose()

An instrument has one owner: nobody else may use its driver at the same time. Every wait has an end on the given
clock. What goes wrong is a `labdaq.errors.DeviceError` that says which instrument and port, what was sent and
received, and what to try. A cancelled call leaves no answer behind that could be taken for the next one.
"""
