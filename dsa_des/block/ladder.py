"""Ladders: the models that can fill one block, from crude to exact, and how they are compared.

A block type declares its ladders (`Component.ladders`); ``dsa-des cost`` climbs them. A ladder says
how a scene's block is turned into each of its rungs, which rung is the reference, and in which
quantities rungs differ. The engine knows no quantity: the ladder's own functions read them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.wake import Wake


class Unavailable(Exception):
    """A rung cannot be had in this scene; the message says what it needs."""


class Verified(NamedTuple):
    """What a model was held against that is not our own code, and how closely it agrees.

    Parameters
    ----------
    what : str
        Of the model.
    oracle : str
        What it was held against.
    tolerance : str
        With its unit.
    test : str
        The test that does it, from the root of the working copy.
    """

    what: str
    oracle: str
    tolerance: str
    test: str


def absolute_difference(value: AnyArray, reference: AnyArray) -> FloatArray:
    """Return the absolute difference of two arrays, element by element."""
    apart: FloatArray = np.abs(value - reference)
    return apart


@dataclass(frozen=True)
class Quantity:
    """Something in which rungs differ, with its unit.

    Parameters
    ----------
    name : str
    unit : str
        Unit of what `difference` returns.
    difference : callable
        From the values of a rung and of the reference to (rows, targets) errors, 0 or more; NaN
        where they cannot be compared.
    tolerance : str
        Key of ``[accuracy]`` that bounds this quantity; empty for none.
    per_tolerance : float
        Units of this quantity in one unit of that key.
    """

    name: str
    unit: str
    difference: Callable[[AnyArray, AnyArray], FloatArray] = absolute_difference
    tolerance: str = ""
    per_tolerance: float = 1.0


@dataclass(frozen=True)
class Rung:
    """One model of a ladder.

    Parameters
    ----------
    name : str
    what : str
        One line for people.
    type_name : str
        Block type that is swapped in; empty keeps the scene's.
    parameters : mapping or callable
        Parameters that are set; a callable gets the scene's block (type and parameters) and may
        raise `Unavailable`.
    shared : mapping
        Parameters that are set here and in the reference this rung is compared with, for a rung
        that answers the same question only in another setting.
    sections : mapping of mappings
        Keys of the scene's tables that are set, by table: what a model is told by the scene and
        not by its block.
    """

    name: str
    what: str
    type_name: str = ""
    parameters: Mapping[str, Any] | Callable[[Mapping[str, Any]], Mapping[str, Any]] = field(
        default_factory=dict
    )
    shared: Mapping[str, Any] = field(default_factory=dict)
    sections: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def parameters_to_set(self, block: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters, by key, that turn a scene's block into this rung.

        Unavailable if the block does not say what the rung needs.
        """
        given = self.parameters(block) if callable(self.parameters) else self.parameters
        return {**self.shared, **given}


#: Reads a ladder's quantities: from a block that has not run, one of its wakes and the reference's
#: block to values by quantity, shape (rows, targets of the roster, ...), NaN where there is none.
Measure = Callable[[Any, Wake, Any], Mapping[str, AnyArray]]

#: Computes the block's error against a far more precise evaluation: from the block, a wake and
#: (n, 2) pairs of row and target to errors by quantity, shape (n,). ImportError when a library that
#: it needs is not installed; `Unavailable` where there is no better evaluation.
Truth = Callable[[Any, Wake, IntArray], Mapping[str, FloatArray]]


@dataclass(frozen=True)
class Ladder:
    """The rungs that fill one contract.

    Parameters
    ----------
    name : str
    rungs : tuple of Rung
        From crude to exact.
    reference : str
        Name of the rung that others are compared with.
    quantities : tuple of Quantity
        The first one is what costs are weighed against.
    measure : callable
        See `Measure`.
    truth : callable, optional
        See `Truth`.
    clears : tuple of str
        Parameters that choose a model by other means and are taken out of the block first.
    applies : callable, optional
        From the scene's own block, set up, to the reason why this ladder changes nothing in this
        scene; empty when it does.
    map_function : str
        ``module:function`` that draws maps of the rungs' errors into a folder and returns their
        paths; empty for none.
    """

    name: str
    rungs: tuple[Rung, ...]
    reference: str
    quantities: tuple[Quantity, ...]
    measure: Measure
    truth: Truth | None = None
    clears: tuple[str, ...] = ()
    applies: Callable[[Any], str] | None = None
    map_function: str = ""

    def __post_init__(self) -> None:
        names = [rung.name for rung in self.rungs]
        if len(set(names)) != len(names):
            raise ValueError(f"ladder {self.name!r}: two rungs have one name: {', '.join(names)}")
        if self.reference not in names:
            raise ValueError(
                f"ladder {self.name!r}: its reference {self.reference!r} is none of its rungs: "
                f"{', '.join(names)}"
            )
        if not self.quantities:
            raise ValueError(f"ladder {self.name!r}: needs at least one quantity")

    def rung(self, name: str) -> Rung:
        """Return a rung by name; KeyError if there is none."""
        return {rung.name: rung for rung in self.rungs}[name]
