"""Whether Stone Soup is there, and what makes its trackers repeatable.

Stone Soup holds tracks and detections in sets, whose order is that of addresses in memory, and
draws from NumPy's and Python's global generators. Neither may show in a recording: while a tracker
works, objects are ordered by when they were first put into a set, and draws come from a state of
its own.
"""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import count
from typing import Any

import numpy as np


def require_stone_soup(what: str) -> None:
    """Raise `UsageError` with how to install Stone Soup if it is missing."""
    try:
        import_module("stonesoup")
    except ImportError as error:
        raise ImportError(f"{what} needs Stone Soup: pip install 'dsa-des[stonesoup]'") from error


class Repeatable:
    """Random state and order of objects that make Stone Soup's results the same in every run."""

    def __init__(self, seed: int) -> None:
        self._numbers = count()
        self._draws = np.random.RandomState(seed % 2**32).get_state()
        self._python = random.Random(seed).getstate()

    @contextmanager
    def isolated_random_state(self) -> Iterator[None]:
        """Let Stone Soup draw from this object's state, and restore global generators and hash."""
        from stonesoup.base import Base

        numbers = self._numbers

        def place(thing: Any) -> int:
            own = object.__getattribute__(thing, "__dict__")
            if "_dsa_des_place" not in own:
                own["_dsa_des_place"] = next(numbers)
            result: int = own["_dsa_des_place"]
            return result

        # The global generators are what Stone Soup draws from.
        theirs, pythons = np.random.get_state(), random.getstate()  # noqa: NPY002
        before = Base.__hash__
        Base.__hash__ = place
        np.random.set_state(self._draws)  # noqa: NPY002
        random.setstate(self._python)
        try:
            yield
        finally:
            self._draws, self._python = np.random.get_state(), random.getstate()  # noqa: NPY002
            np.random.set_state(theirs)  # noqa: NPY002
            random.setstate(pythons)
            Base.__hash__ = before
