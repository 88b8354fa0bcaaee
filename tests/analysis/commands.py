"""What running a command gives."""

from collections.abc import Callable

Run = Callable[..., tuple[int, str, str]]
"""Words of the command line in; exit code, standard output and standard error out."""
