"""The tracks of a tracker of Stone Soup's as they are reported: numbers, states, who measured."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from components.messages.state_tracks import COASTED, CONFIRMED, DELETED
from dsa_des.arrays.types import FloatArray


@dataclass
class Followed:
    """A reported Stone Soup track: number, status, state, covariance, ages and sensors."""

    number: int  # Its own, from 1, in the order of appearance
    status: int = CONFIRMED
    state: FloatArray | None = None  # (6,), position and velocity along north, east, down
    covariance: FloatArray | None = None  # (6, 6)
    state_s: float = 0.0
    updated_s: float = 0.0
    age_s: float = 0.0
    contributors: int = 0  # Masks of sensors
    updated_by: int = 0  # Masks of sensors
    # Whether a range was measured; true of a tracker that does not say what it measured
    ranged: bool = True
    seen: int = 0  # How many of its states were looked at


class Follower:
    """Keeps what is to be reported of each Stone Soup track, updated after every look."""

    def __init__(self, position: "tuple[int, ...]", velocity: "tuple[int, ...]") -> None:
        east, north, up = range(3)
        order = (north, east, up)
        self._rows = [position[i] for i in order] + [velocity[i] for i in order]
        self._signs = np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
        self._tracks: dict[str, Followed] = {}
        self._next = 1

    def update_tracks(
        self, tracks: Any, time_s: float, when: datetime, mask_of: Mapping[str, int]
    ) -> list[Followed]:
        """Update tracks' memory after a look; return all by number, ended ones once as deleted."""
        from components.stone_soup.objects import START

        def seconds(instant: datetime) -> float:
            return time_s if instant == when else (instant - START).total_seconds()

        alive = {track.id: track for track in tracks}
        gone = [self._tracks.pop(name) for name in list(self._tracks) if name not in alive]
        for one in gone:
            one.status = DELETED
        fresh = [track for name, track in alive.items() if name not in self._tracks]
        for track in sorted(fresh, key=self._sort_key):
            self._tracks[track.id] = Followed(self._next)
            self._next += 1
        for name, one in self._tracks.items():
            self._update_followed(one, alive[name], seconds, mask_of)
        return sorted([*gone, *self._tracks.values()], key=lambda one: one.number)

    def __bool__(self) -> bool:
        """Return whether there are tracks."""
        return bool(self._tracks)

    def _sort_key(self, track: Any) -> tuple[float, ...]:
        """Return the track's state as a tuple, which orders tracks of the same instant."""
        state, _ = self._mean_and_covariance(track)
        return tuple(state.tolist())

    def _mean_and_covariance(self, track: Any) -> tuple[FloatArray, FloatArray]:
        try:
            mean = np.array(track.state.mean, dtype=float).reshape(-1)
            spread = np.array(track.state.covar, dtype=float)
        except AttributeError as error:
            raise ValueError(
                f"its states ({type(track.state).__name__}) have no mean and covariance: {error}"
            ) from error
        if max(self._rows) >= len(mean):
            raise ValueError(
                f"its states have {len(mean)} components, and position_mapping or "
                f"velocity_mapping names component {max(self._rows)}: they count from 0"
            )
        state = mean[self._rows] * self._signs
        covariance = spread[np.ix_(self._rows, self._rows)] * np.outer(self._signs, self._signs)
        if not (np.isfinite(state).all() and np.isfinite(covariance).all()):
            raise ValueError("a state or covariance of its is not finite")
        return state, covariance

    def _update_followed(
        self,
        one: Followed,
        track: Any,
        seconds: Callable[[datetime], float],
        mask_of: Mapping[str, int],
    ) -> None:
        one.state, one.covariance = self._mean_and_covariance(track)
        one.state_s = seconds(track.timestamp)
        one.age_s = one.state_s - seconds(track.states[0].timestamp)
        if one.seen > len(track.states):  # a tracker may shorten the past
            one.seen = 0
        last = track.states[-1]
        for state in track.states[one.seen :]:
            measured = _detections_of_state(state)
            if not measured:
                continue
            one.updated_s = seconds(state.timestamp)
            one.updated_by = 0
            # Only angles so far, unless one of these has a range.
            one.ranged = one.ranged and one.contributors != 0
            for detection in measured:
                one.updated_by |= mask_of.get(detection.metadata.get("sensor", ""), 0)
                one.ranged |= len(detection.state_vector) > 2
            one.contributors |= one.updated_by
        one.seen = len(track.states)
        one.status = CONFIRMED if _detections_of_state(last) else COASTED


def _detections_of_state(state: Any) -> list[Any]:
    """Return the detections with which a Stone Soup state was updated; empty for a prediction."""
    hypothesis = getattr(state, "hypothesis", None)
    if hypothesis is None:
        return []
    single = getattr(hypothesis, "single_hypotheses", None)
    hypotheses = [hypothesis] if single is None else single
    return [one.measurement for one in hypotheses if one]
