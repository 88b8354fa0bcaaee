"""What the demo shows while it goes: its steps, how long each took, and what failed."""

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console

from labdaq.clock import NS, Clock
from labdaq.errors import LabdaqError

Say = Callable[[str], None]


class Teller:
    """Tells of steps on standard error; on a terminal what goes on is shown live."""

    def __init__(self, clock: Clock, console: Console | None = None) -> None:
        self.console = console or Console(stderr=True, highlight=False, soft_wrap=True)
        self.took_s: dict[str, float] = {}
        self._clock = clock

    @property
    def live(self) -> bool:
        """Whether somebody is looking."""
        return self.console.is_terminal

    def line(self, text: str) -> None:
        """One line."""
        self.console.print(text, markup=False)

    @contextlib.contextmanager
    def step(self, name: str, what: str, *, spinner: bool = True) -> Iterator[Say]:
        """Time a step; an error in it says which step it was. Yields what changes the live line."""
        begin_ns = self._clock.mono_ns()
        self.line(f"{len(self.took_s) + 1}. {what}")
        try:
            if self.live and spinner:
                with self.console.status("   ...") as status:
                    yield lambda text: status.update(f"   {text}")
            else:
                yield lambda _text: None
        except LabdaqError as error:
            error.message = f"the demo stopped in step '{name}': {error.message}"
            raise
        except Exception as error:
            error.add_note(f"the demo stopped in step '{name}'")
            raise
        self.took_s[name] = (self._clock.mono_ns() - begin_ns) / NS
        self.line(f"   {self.took_s[name]:.1f} s")
