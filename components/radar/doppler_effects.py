"""Doppler processing as an effect: a filter that takes out what moves like the ground."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.radar.clutter_effects import Echo, terrain_of
from components.radar.moving_target_filter import MovingTargetFilter
from components.radar.range_rate import motion_of_cells
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict

_LEAST_GAIN = 1e-30


class DopplerFilter(Effect):
    """Moving-target filter: gains of target and ground by their range rates.

    The range rates are those of the two aircraft as they fly, and of the ground in the target's
    range cell as the ownship flies over it. The notch lies at the ground's (``clutter_lock``) or at
    0. The ground's echo is spread by the beam's width across the ownship's course and by its own
    motion ([terrain] ``clutter_motion_m_s``); rain is blown and falls, and what sidelobes meet lies
    all around.
    """

    lockstep = True
    name = "moving target filter"
    acts_on = "Doppler"
    neutral = False
    outside_the_proof = "every filter takes something from a target"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``moving_target_filter``."""
        kind = block.p.moving_target_filter
        return Verdict(kind != "none", f"moving_target_filter is {kind!r}")

    def build(self, block: Any) -> "DopplerProcessing":
        """Return what gives the gains."""
        return DopplerProcessing(block)


class DopplerProcessing:
    """The gains of one radar's filter; called with cells."""

    def __init__(self, block: Any) -> None:
        p = block.p
        self._filter = MovingTargetFilter(
            p.moving_target_filter, p.prf_hz, block.wavelength_m, p.filter_pulses, p.notch_m_s
        )
        self._locked: bool = p.clutter_lock
        self._limit = 10.0 ** (-0.1 * p.improvement_limit_db)
        self._terrain = terrain_of(block)

    def __call__(self, cells: Cells, echoes: Sequence[Echo]) -> tuple[FloatArray, list[FloatArray]]:
        """Return the factors on the power of each cell's target and of each echo beside it.

        Parameters
        ----------
        cells : Cells
        echoes : sequence of Echo

        Returns
        -------
        target : (cells,)
        beside : list of (cells,)
        """
        if len(cells) == 0:
            return np.empty(0), [np.empty(0)] * len(echoes)
        range_rate_m_s, velocity_m_s = motion_of_cells(cells)
        ground_m_s = -self._along_ground(cells, velocity_m_s)
        centre_m_s = ground_m_s if self._locked else np.zeros(len(cells))
        passed, _ = self._filter.gains(range_rate_m_s - centre_m_s)
        residues = []
        for echo in echoes:
            rate_m_s, spread_m_s = echo.range_rates(cells, velocity_m_s, ground_m_s)
            _, residue = self._filter.gains(
                range_rate_m_s - centre_m_s, rate_m_s - centre_m_s, spread_m_s
            )
            residues.append(residue + self._limit)
        # In the middle of the notch there is still a look, at noise.
        return np.maximum(passed, _LEAST_GAIN), residues

    def _along_ground(self, cells: Cells, velocity_m_s: tuple[FloatArray, ...]) -> FloatArray:
        """Return the ownship's velocity towards the ground in each target's range cell."""
        elevation_rad = cells.elevation_rad
        if self._terrain is not None:
            height_m = cells.of_row("own_alt_m") - self._terrain.height_m
            sine = np.minimum(height_m / np.maximum(cells.range_m, 1.0), 1.0)
            elevation_rad = -np.arcsin(sine)
        level = np.cos(elevation_rad)
        north, east, down = velocity_m_s
        along: FloatArray = (
            north * level * np.cos(cells.azimuth_rad)
            + east * level * np.sin(cells.azimuth_rad)
            - down * np.sin(elevation_rad)
        )
        return along
