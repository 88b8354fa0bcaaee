"""``python -m labdaq`` is the ``labdaq`` command."""

from labdaq.cli import main

main()
