"""Left- and right-censored first and last sightings.

A sighting in a sensor's first scan, or in its last, is not where the target came into sight or went
out of it: the run began or ended there. The summary of a run and the metrics of studies both ask
here.
"""

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray

#: How the two ends of a run are called.
START, END = "the start", "the end of the run"
#: What is said of what did not happen within the run.
NEVER = "never"


def is_in_scan(time: FloatArray | int, scan: FloatArray | int) -> BoolArray:
    """Return which events lie in the first (or last) scan, which may have cut them off."""
    return np.equal(time, scan)


def censoring_text(at: AnyArray, values: FloatArray | None = None) -> AnyArray:
    """Return what a study's column says of values: ``at the start``, ``never`` or nothing.

    `at` is where each is cut off, empty where it is not; values are NaN where it did not happen, if
    that is worth saying.
    """
    result = np.array([f"at {where}" if where else None for where in at.tolist()], dtype=object)
    if values is not None:
        result[np.isnan(values)] = NEVER
    return result
