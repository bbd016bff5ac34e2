"""The error of one measured quantity: a bias, a part that lasts, and a part new at every look."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from components.sensor.error_parameters import StatedError
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.time.gauss_markov import GaussMarkov
from dsa_des.time.randomness import Stream
from dsa_des.time.timeline import first_scan

_NOBODY = np.uint64(0)
_OWN, _OF_SIGNAL = 0, 1


def mean_square(stated: StatedError, drawn_bias: bool) -> float:
    """Return the mean square of what is stated, over all runs where the bias is drawn."""
    return stated.deviation**2 + stated.bias**2 / (3.0 if drawn_bias else 1.0)


class QuantityError:
    """Draws the errors of one quantity.

    Parameters
    ----------
    stated : StatedError
        In the quantity's own unit.
    drawn_bias : bool
        Whether the bias is drawn for each run, uniformly between minus and plus the stated one.
    stream : callable
        Gives the keyed draws of a purpose.
    name : str
        The quantity's.
    """

    def __init__(
        self, stated: StatedError, *, drawn_bias: bool, stream: Callable[[str], Stream], name: str
    ) -> None:
        self._deviation, self._bias, self._drawn = stated.deviation, stated.bias, drawn_bias
        self._biases, self._looks = stream(f"bias of {name}"), stream(f"error of {name}")
        self._lasting: GaussMarkov | None = None
        if stated.correlation_time_s is not None:
            lasting = stream(f"lasting error of {name}")
            self._lasting = GaussMarkov(lasting, stated.correlation_time_s)

    def __call__(
        self,
        keys: npt.ArrayLike,
        scan: IntArray,
        instant_ns: IntArray,
        replica: IntArray,
        variance: FloatArray | None = None,
    ) -> FloatArray:
        """Return the errors of looks.

        Parameters
        ----------
        keys : (n,) array of uint64
            Of the targets.
        scan, instant_ns, replica : (n,) of int
        variance : (n,), optional
            Of what the signal adds at each look.

        Returns
        -------
        (n,) array
        """
        error = self._bias_of(replica) if self._bias else np.zeros(len(scan))
        if self._lasting is not None:
            error = error + self._deviation * self._lasting(keys, instant_ns, replica=replica)
        elif self._deviation:
            error = error + self._deviation * self._looks.normal(keys, scan, _OWN)
        if variance is not None:
            error = error + np.sqrt(variance) * self._looks.normal(keys, scan, _OF_SIGNAL)
        return error

    def _bias_of(self, replica: IntArray) -> FloatArray:
        if not self._drawn:
            return np.full(len(replica), self._bias)
        runs, place = np.unique(replica, return_inverse=True)
        begin = runs * first_scan(1)
        drawn = self._biases.uniform(np.full(len(runs), _NOBODY), begin)
        return (self._bias * (2.0 * drawn - 1.0))[place]
