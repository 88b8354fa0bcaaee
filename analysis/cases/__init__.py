"""Cases: recordings beside what a simulation predicts for the same readings (format ``labdaq-case/1``)."""

from analysis.cases.model import Case, Channel, Records, System, Test, Variant
from analysis.cases.read import read_case
from analysis.cases.write import write_case

__all__ = ["Case", "Channel", "Records", "System", "Test", "Variant", "read_case", "write_case"]
