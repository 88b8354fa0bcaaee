"""A word to who waits while kernels are compiled for the first time."""

import contextlib
from collections.abc import Iterator
from typing import Any, Final

import click

WORDS: Final = "  compiling the ray tracer, once for this version and computer; a minute or more ..."


@contextlib.contextmanager
def compiling_is_told() -> Iterator[None]:
    """Say so on standard error, once, when numba starts to compile; kernels that come from the cache say nothing."""
    from numba.core import event

    said = False

    class _Told(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            nonlocal said
            if not said:
                said = True
                click.echo(WORDS, err=True)

        def on_end(self, event: Any) -> None:
            pass

    listener = _Told()
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)
