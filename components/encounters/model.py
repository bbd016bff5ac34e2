"""An encounter model: where aircraft start, and how they fly on from second to second.

Described in M. J. Kochenderfer, L. P. Espindle, J. K. Kuchar, J. D. Griffith, "Uncorrelated
encounter model of the National Airspace System", MIT Lincoln Laboratory, ATC-345, 2008.
"""

from dataclasses import dataclass

import numpy as np

from components.encounters.bayes_network import BayesNetwork
from dsa_des.arrays.types import BoolArray, FloatArray

#: Altitude layers of the models whose file gives none (``*``), ft above ground.
LAYERS_FT = (500.0, 1200.0, 3000.0, 5000.0, 18000.0)

AIRSPACE, LAYER, GEOGRAPHY = "A", "L", "G"
SPEED, ACCELERATION = "v", "\\dot v"
CLIMB, TURN = "\\dot h", "\\dot \\psi"


@dataclass(frozen=True)
class Bins:
    """What the bins of a variable stand for.

    Parameters
    ----------
    edges : (bins + 1,) or None
        None for a category, whose value is the number of its bin, from 1.
    size : int
    """

    edges: FloatArray | None
    size: int

    @property
    def low(self) -> FloatArray:
        """Where a value of each bin begins; a bin around zero holds zero and nothing else."""
        if self.edges is None:
            return np.arange(1.0, self.size + 1.0)
        return np.where(self._around_zero, 0.0, self.edges[:-1])

    @property
    def width(self) -> FloatArray:
        """How far the values of each bin reach."""
        if self.edges is None:
            return np.zeros(self.size)
        return np.where(self._around_zero, 0.0, np.diff(self.edges))

    @property
    def _around_zero(self) -> BoolArray:
        assert self.edges is not None
        found: BoolArray = (self.edges[:-1] < 0.0) & (self.edges[1:] > 0.0)
        return found


@dataclass(frozen=True)
class EncounterModel:
    """A model as its file gives it, with dynamic variables matched by name.

    Parameters
    ----------
    name : str
    initial : BayesNetwork
        Over the variables at time 0.
    transition : BayesNetwork
        Over those variables (dynamic ones at t) and the dynamic ones at t + 1.
    bins : tuple of Bins
        Of the initial variables.
    resample_rates_hz : (variables,)
        Probability per second of a new value within the same bin.
    sources : tuple of int
        For each variable of the transition network the initial one whose value it is at t, or -1.
    targets : dict of int to int
        Place in the transition network of a variable at t + 1 → the initial variable that it is.
    notes : tuple of str
        What is odd about the file.
    """

    name: str
    initial: BayesNetwork
    transition: BayesNetwork
    bins: tuple[Bins, ...]
    resample_rates_hz: FloatArray
    sources: tuple[int, ...]
    targets: dict[int, int]
    notes: tuple[str, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the initial variables."""
        return self.initial.labels

    @property
    def dynamic(self) -> tuple[int, ...]:
        """Initial variables that change, in the file's order."""
        return tuple(sorted(self.targets.values()))

    def place(self, label: str) -> int | None:
        """Return which initial variable has this name; None where the model has none."""
        return self.labels.index(label) if label in self.labels else None
