"""Random choices that remember what they chose: the features that a scene has."""

import random
from typing import Any


class Dice(random.Random):
    """Python's own generator, which gives the same scene for the same seed on every machine.

    Parameters
    ----------
    seed : int
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        #: Names of what was put into the scene.
        self.features: set[str] = set()

    def chance(self, probability: float, feature: str = "") -> bool:
        """Return True so often; it then counts as a feature of the scene."""
        happens = self.random() < probability
        if happens and feature:
            self.features.add(feature)
        return happens

    def pick(self, *values: Any) -> Any:
        """Return one of the values."""
        return self.choice(values)

    def near(self, low: float, high: float, digits: int = 3) -> float:
        """Return a number between two, with a few digits."""
        return round(self.uniform(low, high), digits)

    def maybe(self, table: dict[str, Any], key: str, probability: float, *values: Any) -> None:
        """Put one of the values into a table, or leave the key out."""
        if self.random() < probability:
            table[key] = self.choice(values)
