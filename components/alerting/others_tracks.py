"""Tracks that came from another platform: how sure they are here and now, and which is oneself."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from components.alert_configuration.configuration import Deviations, largest
from components.association.assignment import gate_threshold
from components.estimation.batched import cholesky, distance_squared
from components.estimation.frame import frame_change
from components.estimation.motion import ConstantVelocity
from components.messages.detections import SensorOffer, sensor_offers
from components.messages.state_tracks import COVARIANCE, StateTracks
from components.navigation.errors import navigation_noise
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Context


@dataclass(frozen=True)
class OthersTracks:
    """What is known of tracks to which no sensor on board has contributed."""

    sensors: frozenset[str]  # Those on other platforms
    own_gate_probability: float  # That a track of oneself is taken for it; 0 for never
    motion: ConstantVelocity  # How targets move while a track is on its way
    navigation_m: tuple[float, float, float]  # Noise of one's own position, north, east, down

    @classmethod
    def of(cls, context: Context, probability: float, intensity_m2_s3: float) -> Self:
        """Return an instance for a block, from its producers' declared sensors and platforms."""
        others = frozenset(
            name
            for name, offer in sensor_offers(context.producers).items()
            if isinstance(offer, SensorOffer) and offer.platform not in ("", context.platform)
        )
        motion = ConstantVelocity(intensity_m2_s3)
        return cls(others, probability, motion, navigation_noise(context)[0])

    def are_of_others_only(self, tracks: StateTracks) -> BoolArray:
        """Return which tracks are of other platforms' sensors alone."""
        on_board = sum(1 << i for i, n in enumerate(tracks.sensors) if n not in self.sensors)
        return np.asarray(tracks.contributors & on_board == 0)

    def judge_tracks(
        self,
        tracks: KeyedTable,
        ahead_s: FloatArray,
        own_place: FloatArray,
        own_velocity: FloatArray,
        instant: IntArray,
    ) -> tuple[BoolArray, Deviations]:
        """Return which tracks are of oneself, and how far all may be wrong as seen from oneself.

        All are carried on to some instants, with the motion's noise, and turned into the axes of
        one's own place (latitude, longitude in rad, height) and velocity (north, east, down). Of
        those in the gate at an instant the nearest is oneself: another one flies beside.
        """
        state, spread = self.motion.predict(tracks.state, _matrices(tracks.covariance), ahead_s)
        lat, lon, alt_m = own_place
        change = frame_change(tracks.origin, np.stack([np.degrees(lat), np.degrees(lon), alt_m]))
        state, spread = change.states(state), change.covariances(spread)
        for i, noise_m in enumerate(self.navigation_m):
            spread[i, i] += noise_m**2
        deviation = np.sqrt(np.stack([spread[i, i] for i in range(6)]))
        deviations = Deviations(
            largest(deviation[1], deviation[0], spread[0, 1]),
            deviation[2],
            largest(deviation[4], deviation[3], spread[3, 4]),
            deviation[5],
        )
        is_own = np.zeros(len(instant), dtype=bool)
        if self.own_gate_probability > 0.0 and len(instant):
            apart = np.concatenate([state[:3], state[3:] - own_velocity])
            far = distance_squared(cholesky(spread), apart)
            order = np.lexsort((far, instant))
            first = np.ones(len(order), dtype=bool)
            first[1:] = instant[order][1:] != instant[order][:-1]
            nearest = order[first]
            inside = far[nearest] <= gate_threshold(self.own_gate_probability, 6)
            is_own[nearest[inside]] = True
        return is_own, deviations


def _matrices(triangle: FloatArray) -> FloatArray:
    """Return covariances (6, 6, n) of their upper triangles (21, n)."""
    result = np.empty((6, 6, triangle.shape[1]))
    for (i, j), values in zip(COVARIANCE, triangle, strict=True):
        result[i, j] = result[j, i] = values
    return result
