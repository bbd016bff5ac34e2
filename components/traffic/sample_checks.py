"""Check the arrays a trajectory is made from."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from components.geometry.angles import FloatArray

LARGEST = 1e12
"""Times, longitudes and angles beyond this carry no useful digits any more."""

_LIMITS = {
    "lat_deg": (90.0, "it must lie in [-90, 90] degrees"),
    "lon_deg": (1e6, "it must lie within ±1e6 degrees"),
    "alt_m": (1e6, "it must lie within ±1e6 metres"),
    "yaw_rad": (1e6, "it must lie within ±1e6 radians"),
    "pitch_rad": (np.pi / 2, "it must lie in [-pi/2, pi/2] radians"),
    "roll_rad": (1e6, "it must lie within ±1e6 radians"),
}


def checked_samples(name: str, **columns: npt.ArrayLike | None) -> dict[str, FloatArray]:
    """Return the given columns as contiguous arrays of one length.

    Parameters
    ----------
    name : str
        The aircraft, for messages.
    **columns : array_like or None
        `time_s` and others; None is left out.

    Returns
    -------
    dict
        The columns that were given, float64, shape (n,).

    Raises
    ------
    ValueError
        Naming the column, the first bad value and what is allowed.
    """
    checked: dict[str, FloatArray] = {}
    for column, values in columns.items():
        if values is None:
            continue
        array = np.array(values, dtype=np.float64, order="C")
        if array.ndim != 1 or len(array) == 0:
            raise ValueError(
                f"{name}: {column} has shape {array.shape}: it must have one axis and at least "
                "one sample"
            )
        limit, allowed = _LIMITS.get(column, (LARGEST, f"it must be finite, within ±{LARGEST:g}"))
        bad = ~(np.abs(array) <= limit)
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(f"{name}: {column} is {array[first]} (sample {first}): {allowed}")
        checked[column] = array
        if len(array) != len(checked["time_s"]):
            raise ValueError(
                f"{name}: {column} has {len(array)} samples: time_s has {len(checked['time_s'])}"
            )
    late = np.diff(checked["time_s"]) <= 0.0
    if late.any():
        first = int(np.argmax(late)) + 1
        raise ValueError(
            f"{name}: time_s is {checked['time_s'][first]} at sample {first}, after "
            f"{checked['time_s'][first - 1]}: times must strictly increase"
        )
    return checked


def all_within_limits(columns: Mapping[str, FloatArray]) -> bool:
    """Tell whether no value of any column, of any shape, is one that `checked_samples` refuses."""
    return all(bool((np.abs(array) <= _LIMITS[name][0]).all()) for name, array in columns.items())
