"""Tracks without a range: what a direction tells of them, and the first range."""

from components.estimation.batched import selected
from components.estimation.frame import Place
from components.estimation.modified_polar import moved_in_polar, ranged_in_polar
from components.tracking.filter_bank import States
from components.tracking.gated_pairs import GatedPairs
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import IntArray


def told_without_range(
    part: TrackStore,
    track: IntArray,
    one: GatedPairs,
    pair: IntArray,
    place: Place,
    states: States,
    covariances: States,
) -> None:
    """Correct tracks without a range in modified polar coordinates, in place.

    Parameters
    ----------
    part : TrackStore
        As predicted.
    track : (k,)
        Which of them were corrected.
    one : GatedPairs
    pair : (k,)
        By which of these.
    place : Place
        Of every track's look.
    states, covariances : lists of (d, k) and (d, d, k)
        After the correction.
    """
    blind = (~part.ranged[track]).nonzero()[0]
    if one.kind.has_range or len(blind) == 0:
        return
    which = track[blind]
    sensor_m = selected(place.position_m, which)
    for before, after, covariance in zip(part.states(), states, covariances, strict=True):
        moved = moved_in_polar(
            selected(before, which), selected(after, blind), selected(covariance, blind), sensor_m
        )
        if one.ranges is not None:
            range_m, variance_m2 = (values[pair[blind]] for values in one.ranges)
            moved = ranged_in_polar(*moved, range_m, variance_m2, sensor_m)
        after[:, blind], covariance[:, :, blind] = moved
