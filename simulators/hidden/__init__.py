"""Concealed physics: an independent light tracer, a dark room, crooked instruments.

Nothing here is shared with, or known to, the code that explains a mismatch: what that code may model in a closed form
is traced, integrated or emulated here. The packages ``simulators.trial`` and the emulated world apply it.
"""
