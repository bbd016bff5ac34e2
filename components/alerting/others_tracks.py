"""Tracks that came from another platform: how sure they are here and now, and which is oneself."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from components.alert_configuration.configuration import Deviations, longest_axis_deviation
from components.association.assignment import squared_gate_distance
from components.estimation.batched import cholesky, mahalanobis_squared
from components.estimation.frame import frame_change
from components.estimation.motion import ConstantVelocity
from components.messages.detections import SensorOffer, offers_of_fused_sensors
from components.messages.state_tracks import COVARIANCE, StateTracks
from components.navigation.errors import position_and_attitude_deviations
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Context


@dataclass(frozen=True)
class OthersTracks:
    """Judges tracks made only on other platforms: which are the ownship, how uncertain all are."""

    sensors: frozenset[str]  # Those on other platforms
    own_gate_probability: float  # That a track of oneself is taken for it; 0 for never
    motion: ConstantVelocity  # How targets move while a track is on its way
    navigation_m: tuple[float, float, float]  # Noise of one's own position, north, east, down

    @classmethod
    def from_context(cls, context: Context, probability: float, intensity_m2_s3: float) -> Self:
        """Return an instance for a block; producers' offers tell other platforms' sensors."""
        others = frozenset(
            name
            for name, offer in offers_of_fused_sensors(context.producers).items()
            if isinstance(offer, SensorOffer) and offer.platform not in ("", context.platform)
        )
        motion = ConstantVelocity(intensity_m2_s3)
        return cls(others, probability, motion, position_and_attitude_deviations(context)[0])

    def are_of_others_only(self, tracks: StateTracks) -> BoolArray:
        """Return a mask of the tracks to which only sensors on other platforms have contributed."""
        on_board = sum(1 << i for i, n in enumerate(tracks.sensors) if n not in self.sensors)
        return np.asarray(tracks.contributors & on_board == 0)

    def own_tracks_and_deviations(
        self,
        tracks: KeyedTable,
        ahead_s: FloatArray,
        own_place: FloatArray,
        own_velocity: FloatArray,
        instant: IntArray,
    ) -> tuple[BoolArray, Deviations]:
        """Return a mask of the ownship's tracks, and all deviations predicted to their instants.

        All are carried on to some instants, with the motion's noise, and turned into the axes of
        one's own place (latitude, longitude in rad, height) and velocity (north, east, down). Of
        those in the gate at an instant the nearest is oneself: another one flies beside.
        """
        state, spread = self.motion.predict(
            tracks.state, _full_covariances(tracks.covariance), ahead_s
        )
        lat, lon, alt_m = own_place
        change = frame_change(tracks.origin, np.stack([np.degrees(lat), np.degrees(lon), alt_m]))
        state, spread = change.states(state), change.covariances(spread)
        for i, noise_m in enumerate(self.navigation_m):
            spread[i, i] += noise_m**2
        deviation = np.sqrt(np.stack([spread[i, i] for i in range(6)]))
        deviations = Deviations(
            longest_axis_deviation(deviation[1], deviation[0], spread[0, 1]),
            deviation[2],
            longest_axis_deviation(deviation[4], deviation[3], spread[3, 4]),
            deviation[5],
        )
        is_own = np.zeros(len(instant), dtype=bool)
        if self.own_gate_probability > 0.0 and len(instant):
            apart = np.concatenate([state[:3], state[3:] - own_velocity])
            far = mahalanobis_squared(cholesky(spread), apart)
            order = np.lexsort((far, instant))
            first = np.ones(len(order), dtype=bool)
            first[1:] = instant[order][1:] != instant[order][:-1]
            nearest = order[first]
            inside = far[nearest] <= squared_gate_distance(self.own_gate_probability, 6)
            is_own[nearest[inside]] = True
        return is_own, deviations


def _full_covariances(triangle: FloatArray) -> FloatArray:
    """Return covariances (6, 6, n) of their upper triangles (21, n)."""
    result = np.empty((6, 6, triangle.shape[1]))
    for (i, j), values in zip(COVARIANCE, triangle, strict=True):
        result[i, j] = result[j, i] = values
    return result
