"""Echoes of rain beside a target's; of rain and ground in the sidelobes, and of other pulses.

An echo from R arrives when those of R ± k c / 2PRF do, of pulses sent earlier or later. A radar of
medium PRF over ground so hears, beside a target that is far, the ground that is near.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.atmosphere.rain_echo import (
    fall_speed_m_s,
    rain_reflectivity_per_m,
    rain_shell_m3,
    rain_velocity_deviation_m_s,
    rain_volume_m3,
)
from components.geometry import SEMI_MAJOR_AXIS_M
from components.radar.ground_clutter import (
    CLUTTER,
    Echo,
    NoEcho,
    Velocity,
    ground_clutter_rcs_m2,
    ground_ring_rcs_m2,
    height_above_terrain_m,
    platform_range_rate_spread_m_s,
    scene_altitude_line_rcs_m2,
    terrain_of,
)
from components.radar.pulse_trains.ambiguity import unambiguous_range_m
from components.radar.resolution import CELL_SIZES, cell_azimuth_elevation_range
from components.sensor.look import Cells
from components.sensor.weather_cells import (
    weather_cells,
    weather_cells_on_sight_lines,
    weather_cells_verdict,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class RainClutter(Effect[Echo]):
    """Echo of rain in each target's resolution cell.

    In a cell of ``[weather] cells`` it rains as it does there and everywhere together.

    The beam points at the target. Drops scatter after Rayleigh, by the rain rate (Z = 200 R^1.6);
    the air and the rain on the way take from their echo what they take from the target's. It
    fluctuates like noise from pulse to pulse. It moves with the wind and falls.
    """

    name = "rain echo"
    acts_on = CLUTTER

    def verdict(self, block: Any) -> Verdict:
        """Return whether rain clutter is simulated: needs rain, a carrier and a range cell."""
        rate = _rain_rate(block)
        because = f"[weather] rain_rate_mm_h is {rate:g}"
        somewhere = Verdict(False, "")
        if any(one.rain_rate_mm_h for one in weather_cells(block)):
            somewhere = weather_cells_verdict(block)
            because = because if rate else somewhere.because
        if (rate or somewhere.simulated) and (why := why_no_rain_echo(block)):
            return Verdict(False, why)
        return Verdict(rate > 0 or somewhere.simulated, because)

    def build(self, block: Any) -> Echo:
        """Return the echo of rain; one of zero power where rain clutter is not simulated."""
        p = block.p
        rain = self.verdict(block).simulated
        if rain and p.pulses_summed > 1 and p.clutter_threshold == "noise":
            raise ValueError(
                f"clutter_threshold is 'noise' and {p.pulses_summed} pulses are summed: rain "
                "beside a threshold that stays is known for one look only; set it to 'adaptive'"
            )
        return RainEcho(block) if rain else NoEcho(block)


class RainEcho(Echo):
    """Echo of the rain in the beam at the target's range."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self.weather = block.context.sections["weather"]
        self.per_m = float(rain_reflectivity_of(block, _rain_rate(block)))
        self.lowest_m = -math.inf if self.terrain is None else self.terrain.height_m
        towards = math.radians(self.weather.wind_from_deg) + math.pi
        wind = self.weather.wind_mps
        fall_m_s = float(fall_speed_m_s(self.weather.rain_rate_mm_h))
        self.moves_m_s = wind * math.cos(towards), wind * math.sin(towards), fall_m_s
        self._somewhere = any(one.rain_rate_mm_h for one in weather_cells(block))

    def rate_mm_h(self, cells: Cells) -> FloatArray:
        """Return the rain rate at each cell's target, mm/h."""
        rate = np.full(len(cells), float(self.weather.rain_rate_mm_h))
        for one, within in weather_cells_on_sight_lines(self.block, cells):
            rate += np.where(within.leaves >= 1.0, one.rain_rate_mm_h, 0.0)
        return rate

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS of the rain in each cell's resolution cell, m²."""
        per_m: float | FloatArray = self.per_m
        if self._somewhere:
            per_m = rain_reflectivity_of(self.block, self.rate_mm_h(cells))
        volume_m3 = rain_volume_m3(
            cells.range_m,
            cells.elevation_rad,
            cells.alt_m,
            azimuth_beamwidth_rad=self.beam_rad[0],
            elevation_beamwidth_rad=self.beam_rad[1],
            range_resolution_m=self.depth_m,
            lowest_m=self.lowest_m,
            highest_m=self.weather.rain_top_m,
        )
        return np.asarray(per_m * volume_m3)

    def range_rate_mean_and_spread(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean range rate of rain by wind, fall and ownship, and its spread by shear,
        turbulence and beamwidth, m/s.
        """
        level = np.cos(cells.elevation_rad)
        sight = (
            level * np.cos(cells.azimuth_rad),
            level * np.sin(cells.azimuth_rad),
            -np.sin(cells.elevation_rad),
        )
        *wind, fall = self.moves_m_s
        if self._somewhere:
            fall = fall_speed_m_s(self.rate_mm_h(cells))
        past = [rain - own for rain, own in zip((*wind, fall), own_m_s, strict=True)]
        mean = sum(part * along for part, along in zip(past, sight, strict=True))
        speed_m_s = np.sqrt(sum(part * part for part in past))
        # Rounding alone may put a rate beyond the speed that it is part of.
        rate = np.clip(mean, -speed_m_s, speed_m_s)
        platform = platform_range_rate_spread_m_s(speed_m_s, rate, self.beam_rad[0])
        own = rain_velocity_deviation_m_s(cells.range_m, cells.elevation_rad, self.beam_rad[1])
        return np.asarray(mean), np.hypot(own, platform)


class SidelobeClutter(Effect[Echo]):
    """Ground and rain at the target's range all around, received through the sidelobes.

    All sidelobes have one mean level (``sidelobe_level_db``), towards the ground below as well:
    the altitude line is in it, mirrored as ``facet_slope_deg`` of the terrain says. Flown over,
    they have range rates of every direction, so that a moving-target filter takes little of them.
    """

    name = "sidelobe clutter"
    acts_on = CLUTTER

    def verdict(self, block: Any) -> Verdict:
        """Return whether sidelobes receive clutter: needs ``sidelobe_level_db``, ground or rain."""
        level_db = block.p.sidelobe_level_db
        if level_db is None:
            return Verdict(False, "sidelobe_level_db is not given")
        if not cell_azimuth_elevation_range(block.p)[2]:
            return Verdict(False, "range_resolution_m is 0: no cell, no clutter in it")
        rain = _rain_rate(block) and block.wavelength_m is not None
        if terrain_of(block) is None and not rain:
            return Verdict(False, "there is neither [terrain] height_m nor rain")
        return Verdict(True, f"sidelobe_level_db is {level_db:g}")

    def build(self, block: Any) -> Echo:
        """Return the echo through the sidelobes; one of zero power where it is not simulated."""
        return SidelobeEcho(block) if self.verdict(block).simulated else NoEcho(block)


class SidelobeEcho(Echo):
    """Echo of ground and rain at the target's range in all directions, at the sidelobes' level."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self.two_way = 10.0 ** (0.2 * block.p.sidelobe_level_db)
        self.weather = block.context.sections["weather"]
        self.per_m = 0.0
        if self.weather.rain_rate_mm_h and block.wavelength_m is not None:
            self.per_m = float(rain_reflectivity_of(block, _rain_rate(block)))

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS of ground and rain at each cell's range, m², below the sidelobes."""
        own_alt_m, step_m = cells.field_at_rows("own_alt_m"), self.depth_m
        rcs = np.zeros(len(cells))
        lowest_m = -math.inf
        if self.terrain is not None:
            lowest_m = self.terrain.height_m
            rcs = rcs + ground_ring_rcs_m2(
                cells.range_m, height_above_terrain_m(own_alt_m, lowest_m),
                gamma_db=self.terrain.clutter_gamma_db, range_resolution_m=step_m,
            )  # fmt: skip
            height_m = height_above_terrain_m(own_alt_m, lowest_m)
            rcs = rcs + scene_altitude_line_rcs_m2(self.block, cells.range_m, height_m)
        if self.per_m:
            rcs = rcs + self.per_m * rain_shell_m3(
                cells.range_m, own_alt_m, range_resolution_m=step_m, lowest_m=lowest_m,
                highest_m=self.weather.rain_top_m,
            )  # fmt: skip
        return self.two_way * rcs

    def range_rate_mean_and_spread(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean range rate 0, and the spread of own speed over all directions, m/s."""
        north, east, _ = own_m_s
        return np.zeros(len(cells)), np.sqrt(0.5 * (north * north + east * east))


#: Beyond it nothing of the ground or of rain is summed, m: the horizon of 9,000 m without air.
_FARTHEST_M = math.sqrt(2.0 * SEMI_MAJOR_AXIS_M * 9000.0)


def ambiguous_ranges_m(
    range_m: FloatArray, fold_m: float, farthest_m: float
) -> Iterator[FloatArray]:
    """Yield, per fold, other ranges up to `farthest_m` whose echoes arrive with those of `range_m`.

    Nearest first; infinite where there is none.
    """
    own = np.floor(range_m / fold_m)
    first = range_m - own * fold_m
    for number in range(math.ceil(farthest_m / fold_m) + 1):
        other = first + number * fold_m
        there = (own != number) & (other > 0.0) & (other <= farthest_m)
        if there.any():
            yield np.where(there, other, np.inf)


class FoldedClutter(Effect[Echo]):
    """Ground and rain from other pulses, in the beam and through the sidelobes.

    Of several PRFs those count that hear least of it, as many as must see a target. The air on the
    way is taken to weaken it as it does a target's echo. Its range rates are those of the ground
    from where most of it comes.
    """

    name = "folded clutter"
    acts_on = CLUTTER

    def verdict(self, block: Any) -> Verdict:
        """Return whether folded clutter is simulated: needs ``range_folds``, and ground or rain."""
        if not block.p.range_folds:
            return Verdict(False, "range_folds is false")
        rain = block.context.sections["weather"].rain_rate_mm_h
        if terrain_of(block) is None and not (rain and not why_no_rain_echo(block)):
            return Verdict(False, "there is neither [terrain] height_m nor rain")
        every = " or ".join(f"{unambiguous_range_m(f) / 1e3:.4g}" for f in block.p.prfs_hz)
        return Verdict(True, f"range_folds is true: clutter of every {every} km beside a target's")

    def build(self, block: Any) -> Echo:
        """Return the echo from other ambiguous ranges; zero power where it is not simulated."""
        if not self.verdict(block).simulated:
            return NoEcho(block)
        return FoldedEcho(block)


class FoldedEcho(Echo):
    """The sum of the clutter at all ambiguous ranges, as RCS at the target's range."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self._weather = block.context.sections["weather"]
        self._nearest_m = block.p.minimum_range_m or 0.0
        level_db = block.p.sidelobe_level_db
        self._two_way = 0.0 if level_db is None else 10.0 ** (0.2 * level_db)
        rate = self._weather.rain_rate_mm_h
        rains = rate > 0.0 and not why_no_rain_echo(block)
        self._per_m = float(rain_reflectivity_of(block, rate)) if rains else 0.0

    def __call__(self, cells: Any) -> FloatArray:
        """Return the folded clutter's RCS for the PRFs that decide, m²."""
        each = np.stack(
            [self._folded_rcs_and_source_range(cells, prf_hz)[0] for prf_hz in self.block.p.prfs_hz]
        )
        needed: int = self.block.p.prfs_needed or len(each)
        return np.asarray(np.sort(each, axis=0)[needed - 1])

    def _folded_rcs_and_source_range(
        self, cells: Cells, prf_hz: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return a PRF's folded clutter as RCS at the target (m²) and its main source range (m)."""
        total, most, where = np.zeros(len(cells)), np.zeros(len(cells)), np.array(cells.range_m)
        for other_m in ambiguous_ranges_m(cells.range_m, unambiguous_range_m(prf_hz), _FARTHEST_M):
            heard = np.isfinite(other_m) & (other_m >= self._nearest_m)
            at_m = np.where(heard, other_m, 1.0)
            rcs = (
                np.where(heard, self._ground_and_rain_rcs_m2(cells, at_m), 0.0)
                * (cells.range_m / at_m) ** 4
            )
            total += rcs
            where = np.where(rcs > most, at_m, where)
            most = np.maximum(most, rcs)
        return total, where

    def _ground_and_rain_rcs_m2(self, cells: Cells, at_m: FloatArray) -> FloatArray:
        """Return the RCS of ground and rain at other ranges of each cell's beam."""
        azimuth, elevation = self.beam_rad
        own_m, lowest_m = cells.field_at_rows("own_alt_m"), -math.inf
        rcs = np.zeros(len(cells))
        if self.terrain is not None:
            lowest_m = self.terrain.height_m
            height_m = height_above_terrain_m(own_m, lowest_m)
            rcs += ground_clutter_rcs_m2(
                at_m, cells.elevation_rad, height_m, gamma_db=self.terrain.clutter_gamma_db,
                azimuth_beamwidth_rad=azimuth, elevation_beamwidth_rad=elevation,
                range_resolution_m=self.depth_m,
            )  # fmt: skip
            if self._two_way:
                rcs += self._two_way * ground_ring_rcs_m2(
                    at_m, height_m, gamma_db=self.terrain.clutter_gamma_db,
                    range_resolution_m=self.depth_m,
                )  # fmt: skip
                rcs += self._two_way * scene_altitude_line_rcs_m2(self.block, at_m, height_m)
        if self._per_m:
            rcs += self._per_m * rain_volume_m3(
                at_m, cells.elevation_rad, own_m + at_m * np.sin(cells.elevation_rad),
                azimuth_beamwidth_rad=azimuth, elevation_beamwidth_rad=elevation,
                range_resolution_m=self.depth_m, lowest_m=lowest_m,
                highest_m=self._weather.rain_top_m,
            )  # fmt: skip
        return rcs

    def range_rate_mean_and_spread(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and spread of the range rate of ground, or of the beam's axis, at the range
        where most of the clutter comes from, m/s.
        """
        _, at_m = self._folded_rcs_and_source_range(cells, self.block.p.prf_hz)
        elevation = cells.elevation_rad
        if self.terrain is not None:
            height_m = cells.field_at_rows("own_alt_m") - self.terrain.height_m
            elevation = -np.arcsin(np.minimum(height_m / at_m, 1.0))
        level = np.cos(elevation)
        towards = (
            level * np.cos(cells.azimuth_rad), level * np.sin(cells.azimuth_rad), -np.sin(elevation)
        )  # fmt: skip
        rate = -sum(own * part for own, part in zip(own_m_s, towards, strict=True))
        speed_m_s = np.sqrt(sum(part * part for part in own_m_s))
        platform = platform_range_rate_spread_m_s(speed_m_s, rate, self.beam_rad[0])
        moves_m_s = 0.0 if self.terrain is None else self.terrain.clutter_motion_m_s
        return np.asarray(rate), np.hypot(moves_m_s, platform)


def why_no_rain_echo(block: Any) -> str:
    """Return why rain has no echo for a radar; empty where it has one."""
    if block.wavelength_m is None:
        return "frequency_hz is not given: how strongly drops scatter follows from it"
    for width, (beam, step) in zip(cell_azimuth_elevation_range(block.p), CELL_SIZES, strict=True):
        if not width:
            return f"{step} is 0 and {beam} is not given: no cell, no rain in it"
    return ""


def rain_reflectivity_of(block: Any, rate_mm_h: ArrayLike) -> Any:
    """Return the RCS per volume of rain as the radar receives it, 1/m."""
    per_m = rain_reflectivity_per_m(rate_mm_h, block.wavelength_m)
    if block.p.polarisation == "circular":
        per_m *= 10.0 ** (-0.1 * block.p.rain_rejection_db)
    return per_m


def _rain_rate(block: Any) -> float:
    weather = block.context.sections.get("weather")
    return 0.0 if weather is None else float(weather.rain_rate_mm_h)
