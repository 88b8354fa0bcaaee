"""Byte lines of emulated instruments: pseudo-terminals, TCP and memory, with a serial line's pace and faults."""

from simulators.line.faults import Corrupt, Disconnect, Drop, Echo, FaultBox, Garbage, Late, LineFault, Truncate
from simulators.line.paced import Line, SerialFormat
from simulators.line.ports import MemoryPort, Port, PtyPort, TcpPort, open_pty, open_tcp
from simulators.line.wires import PipeWire, StreamWire, Wire

__all__ = [
    "Corrupt",
    "Disconnect",
    "Drop",
    "Echo",
    "FaultBox",
    "Garbage",
    "Late",
    "Line",
    "LineFault",
    "MemoryPort",
    "PipeWire",
    "Port",
    "PtyPort",
    "SerialFormat",
    "StreamWire",
    "TcpPort",
    "Truncate",
    "Wire",
    "open_pty",
    "open_tcp",
]
