"""Which chunk is run next, and again when its process died.

A chunk whose process dies is run once more; then it is cut in halves until the guilty run is alone.
A single run is tried again when nothing else is under way, so that neither the memory of others nor
a kill of all workers is its fault. Only then it has crashed.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

from dsa_des.studies.chunk import Done, crashed_run, joined
from dsa_des.studies.study import Chunk, Study

#: How often a chunk may lose its process before it is cut.
_PATIENCE = 2
#: How often a single run may lose its process before it has crashed.
TRIES = 3


@dataclass(frozen=True)
class Piece:
    """A chunk or some of its runs, and how often their process died."""

    chunk: Chunk
    losses: int = 0


class Attempts:
    """What is still to be run."""

    def __init__(self, study: Study, chunks: Iterable[Chunk]) -> None:
        self._study = study
        self._todo = iter(chunks)
        self._again: list[Piece] = []
        self._alone: deque[Piece] = deque()
        self._running = 0
        self._only = False
        #: Of chunks that were cut: how many runs are missing, and what is there.
        self._missing: dict[str, int] = {}
        self._there: dict[str, list[Done]] = {}

    def next(self) -> Piece | None:
        """Return what to run next; None if nothing may be begun now."""
        piece = None
        if self._only:
            return None
        if self._again:
            piece = self._again.pop()
        elif (chunk := next(self._todo, None)) is not None:
            piece = Piece(chunk)
        elif self._alone and not self._running:
            piece, self._only = self._alone.popleft(), True
        self._running += piece is not None
        return piece

    def give_back(self, piece: Piece) -> None:
        """Take back what was not begun, or was lost through no fault of its own."""
        self._ended()
        self._again.append(piece)

    def done(self, piece: Piece, result: Done) -> Done | None:
        """Take the result of a piece; return that of its chunk when all of it is there."""
        self._ended()
        return self._collect(piece, result)

    def lost(self, piece: Piece) -> Done | None:
        """Take back a piece whose process died; return its chunk's result if that was the last."""
        self._ended()
        chunk, losses = piece.chunk, piece.losses + 1
        if len(chunk) == 1:
            if losses < TRIES:
                self._alone.append(Piece(chunk, losses))
                return None
            return self._collect(piece, crashed_run(self._study, chunk, TRIES))
        if losses < _PATIENCE:
            self._again.append(Piece(chunk, losses))
            return None
        self._missing.setdefault(chunk.name, len(chunk))
        # A single run begins to count anew; halves were warned.
        for half in halves(chunk):
            self._again.append(Piece(half, 0 if len(half) == 1 else losses - 1))
        return None

    def _ended(self) -> None:
        self._running -= 1
        self._only = False

    def _collect(self, piece: Piece, result: Done) -> Done | None:
        name = piece.chunk.name
        if name not in self._missing:
            return result
        self._there.setdefault(name, []).append(result)
        self._missing[name] -= result.runs
        if self._missing[name]:
            return None
        del self._missing[name]
        return joined(name, self._there.pop(name))


def halves(chunk: Chunk) -> tuple[Chunk, Chunk]:
    """Return the first and the second half of a chunk's runs."""
    left = len(chunk) // 2
    first: list[tuple[int, int, int]] = []
    second: list[tuple[int, int, int]] = []
    for cell, start, end in chunk.runs:
        cut = min(end, start + left)
        left -= cut - start
        first += [(cell, start, cut)] * (start < cut)
        second += [(cell, cut, end)] * (cut < end)
    return replace(chunk, runs=tuple(first)), replace(chunk, runs=tuple(second))
