"""Emulated instruments on real wires, observing one world; and the physics that trials conceal."""
