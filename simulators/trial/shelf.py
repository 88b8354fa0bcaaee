"""Responses of skylights, fetched once per process and kept while they are in use."""

from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

from simulators.hidden.responses import Response, response
from simulators.trial.stock import Wanted


class Shelf:
    """Hands out responses, from memory, from disk, or traced now.

    Parameters
    ----------
    folder
        Where responses are kept on disk; the user's cache by default.
    rays_per_node
        Quality of those that have to be traced; ``None`` for the usual.
    progress
        Called with a name, and how many of how many suns are traced.
    keep
        How many responses to hold in memory.
    """

    def __init__(
        self,
        folder: Path | None = None,
        rays_per_node: int | None = None,
        progress: Callable[[str, int, int], None] | None = None,
        keep: int = 24,
    ) -> None:
        self._folder = folder
        self._rays = rays_per_node
        self._progress = progress
        self._keep = keep
        self._held: OrderedDict[Wanted, Response] = OrderedDict()

    def __call__(self, wanted: Wanted) -> Response:
        """Fetch one response."""
        if wanted in self._held:
            self._held.move_to_end(wanted)
            return self._held[wanted]

        def tell(done: int, of: int) -> None:
            if self._progress is not None:
                self._progress(str(wanted), done, of)

        options = {} if self._rays is None else {"rays_per_node": self._rays}
        found = response(wanted.skylight(), folder=self._folder, progress=tell, **options)
        self._held[wanted] = found
        while len(self._held) > self._keep:
            self._held.popitem(last=False)
        return found
