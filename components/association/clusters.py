"""Clusters: tracks and detections that share gates, and can be decided apart from all others."""

import numpy as np

from dsa_des.arrays.types import BoolArray, IntArray


def alone(track: IntArray, detection: IntArray) -> BoolArray:
    """Return which pairs are the only one of both their track and their detection.

    Parameters
    ----------
    track, detection : (pairs,)
        Numbers of the track and of the detection in whose gate they are, from 0.
    """
    if len(track) == 0:
        return np.zeros(0, dtype=bool)
    tracks, detections = np.bincount(track), np.bincount(detection)
    return np.asarray((tracks[track] == 1) & (detections[detection] == 1))


def labels(track: IntArray, detection: IntArray) -> IntArray:
    """Return the cluster of each pair: its least track number.

    Parameters
    ----------
    track, detection : (pairs,)
    """
    if len(track) == 0:
        return np.zeros(0, dtype=np.int64)
    of_track = np.arange(int(track.max()) + 1)
    while True:
        of_detection = np.full(int(detection.max()) + 1, len(of_track))
        np.minimum.at(of_detection, detection, of_track[track])
        lower = of_track.copy()
        np.minimum.at(lower, track, of_detection[detection])
        if np.array_equal(lower, of_track):
            return of_track[track]
        of_track = lower


def groups(label: IntArray) -> list[IntArray]:
    """Return the pairs of each cluster, clusters by label, pairs in their own order."""
    if len(label) == 0:
        return []
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    return np.split(order, cuts)
