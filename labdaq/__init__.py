"""labdaq runs a daylight laboratory: it records sky and skylight, simulates both, and explains where they differ.

This package is the application: the vocabulary all rooms share (`Reading`, `Clock`, units, directions, errors), station
and script files, the scheduler, the session on disk, and the command line. Instruments live in `drivers`, their
emulators in `simulators`, everything after the recording in `analysis`.
"""

__version__ = "0.1.0"
