"""The demo: an emulated station in which one thing is concealed, from its instruments' wires to a report that names it."""
