"""The demo: an emulated station that conceals one thing, from its instruments' wires to a report that names it."""
