"""Are covariances of tracks honest? ``python -m docs.make.track_consistency`` measures it.

Scenes with stated errors, a banked ownship on the southern hemisphere and many replicas; at some
instants the mean normalised error squared (NEES) of the tracks' position and velocity, 6 where
they are honest, with its 95 % bounds by chi-square for as many tracks as there are
(Bar-Shalom, Li, Kirubarajan (2001), §5.4.2).
"""

from docs.make.track_consistency.cases import CASES, NEARLY, NOISY, OWNSHIP, SENSORS, Case
from docs.make.track_consistency.nees import bounds, nees_of, summary
from docs.make.track_consistency.scenes import scene_of_case

__all__ = [
    "CASES",
    "NEARLY",
    "NOISY",
    "OWNSHIP",
    "SENSORS",
    "Case",
    "bounds",
    "nees_of",
    "scene_of_case",
    "summary",
]
