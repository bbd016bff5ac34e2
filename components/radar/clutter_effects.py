"""Clutter as effects on a radar's detections: the ground, rain, and both through sidelobes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.radar.field_of_view import cell_size
from components.radar.ground_clutter import (
    ground_clutter_rcs_m2,
    ground_ring_rcs_m2,
    height_above_terrain_m,
)
from components.radar.moving_target_filter import platform_spread_m_s
from components.radar.resolution_parameters import CELL_SIZES
from components.radar.volume_clutter import (
    fall_speed_m_s,
    rain_reflectivity_per_m,
    rain_shell_m3,
    rain_spread_m_s,
    rain_volume_m3,
)
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict

Velocity = tuple[FloatArray, FloatArray, FloatArray]
_CELL = ("azimuth_resolution_deg", "elevation_resolution_deg", "range_resolution_m")


class GroundClutter(Effect):
    """Echo of flat terrain in the cell of each target, where the beam meets it.

    The beam points at the target and is as wide as a resolution cell, unless the scene gives its
    beamwidths; clutter more than two beamwidths off its axis is 0. The air takes from the echo of
    the ground what it takes from the target's. What the threshold does there is said by
    ``clutter_threshold``.
    """

    lockstep = True
    name = "ground clutter"
    acts_on = "clutter"

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[terrain] height_m``."""
        terrain = terrain_of(block)
        if terrain is None:
            return Verdict(False, "[terrain] height_m is not given")
        return Verdict(True, f"[terrain] height_m is {terrain.height_m:g}")

    def build(self, block: Any) -> Echo:
        """Return each cell's ground clutter as an RCS, m²; without terrain it is 0."""
        terrain = terrain_of(block)
        if terrain is None:
            return NoEcho(block)
        for width, name in zip(cell_size(block.p), _CELL, strict=True):
            if width == 0:
                raise ValueError(
                    f"{name} is 0: ground clutter fills a resolution cell, it must be above 0"
                )
        if block.p.pulses_summed > 1:
            if block.p.budget == "dwell" and block.p.integration == "noncoherent":
                raise ValueError(
                    f"integration is 'noncoherent', which sums {block.p.pulses_summed} pulses: "
                    "ground clutter is known for one look only; set it to 'coherent'"
                )
            raise ValueError(
                f"pulses is {block.p.pulses_summed}: ground clutter is known for one look only; "
                "set it to 1, with integration_gain_db for pulses integrated coherently"
            )

        if terrain.clutter_mean == "constant" and block.p.cfar_reference_cells is not None:
            raise ValueError(
                f"cfar_reference_cells is {block.p.cfar_reference_cells} and [terrain] "
                "clutter_mean is 'constant': an average of cells is known for clutter that "
                "fluctuates; leave one of them out"
            )

        return GroundEcho(block, terrain)


@dataclass(frozen=True)
class Clutter:
    """Power of clutter over noise, by the cells of a look.

    Parameters
    ----------
    mean : (cells,)
        Of the patch of ground amid the beam.
    diffuse : (cells,)
        Of what is more noise: rain, and what sidelobes meet.
    """

    mean: FloatArray
    diffuse: FloatArray

    @property
    def total(self) -> FloatArray:
        """Both together."""
        return self.mean + self.diffuse

    def of(self, chosen: Any) -> Clutter:
        """Return that of some cells."""
        return Clutter(self.mean[chosen], self.diffuse[chosen])


class Echo:
    """What gives an echo beside the target; called with cells, it returns its RCS in m².

    Parameters
    ----------
    block : Radar
    """

    #: Whether it adds to noise; else it is the mean that ``clutter_mean`` speaks of.
    diffuse = True

    def __init__(self, block: Any) -> None:
        self.block = block
        self.terrain = terrain_of(block)
        *self.beam_rad, self.depth_m = cell_size(block.p)

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS in each cell's resolution cell, m²."""
        raise NotImplementedError

    def range_rates(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation of its range rates in each cell, m/s.

        Parameters
        ----------
        cells : Cells
        own_m_s : (north, east, down), each (cells,)
            The ownship's velocity over ground.
        ground_m_s : (cells,)
            Range rate of the ground on the beam's axis.
        """
        raise NotImplementedError


class GroundEcho(Echo):
    """The patch of ground that beam and range cell share."""

    diffuse = False

    def __init__(self, block: Any, terrain: Any) -> None:
        super().__init__(block)
        self.terrain = terrain

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS of the ground in each cell's resolution cell, m²."""
        height_m = height_above_terrain_m(cells.of_row("own_alt_m"), self.terrain.height_m)
        rcs = ground_clutter_rcs_m2(
            cells.range_m,
            cells.elevation_rad,
            height_m,
            gamma_db=self.terrain.clutter_gamma_db,
            azimuth_beamwidth_rad=self.beam_rad[0],
            elevation_beamwidth_rad=self.beam_rad[1],
            range_resolution_m=self.depth_m,
        )
        return np.asarray(rcs)

    def range_rates(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Spread by the beam's width across the ownship's course, and by the ground's own."""
        speed_m_s = np.sqrt(sum(part * part for part in own_m_s))
        platform = platform_spread_m_s(speed_m_s, ground_m_s, self.beam_rad[0])
        return ground_m_s, np.hypot(self.terrain.clutter_motion_m_s, platform)


class RainClutter(Effect):
    """Echo of rain in the resolution cell of each target, as far as it rains there.

    The beam points at the target. Drops scatter after Rayleigh, by the rain rate (Z = 200 R^1.6);
    the air and the rain on the way take from their echo what they take from the target's. It
    fluctuates like noise from pulse to pulse. It moves with the wind and falls.
    """

    lockstep = True
    name = "rain echo"
    acts_on = "clutter"

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[weather] rain_rate_mm_h``, and for a carrier and a cell."""
        rate = _rain_rate(block)
        because = f"[weather] rain_rate_mm_h is {rate:g}"
        if rate and (why := no_rain_echo(block)):
            return Verdict(False, why)
        return Verdict(rate > 0, because)

    def build(self, block: Any) -> Echo:
        """Return what gives the rain's RCS, 0 without rain."""
        p = block.p
        rain = self.verdict(block).simulated
        if rain and p.pulses_summed > 1 and p.clutter_threshold == "noise":
            raise ValueError(
                f"clutter_threshold is 'noise' and {p.pulses_summed} pulses are summed: rain "
                "beside a threshold that stays is known for one look only; set it to 'adaptive'"
            )
        return RainEcho(block) if rain else NoEcho(block)


class RainEcho(Echo):
    """Rain in the beam."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self.weather = block.context.sections["weather"]
        self.per_m = rain_reflectivity_of(block)
        self.lowest_m = -math.inf if self.terrain is None else self.terrain.height_m
        towards = math.radians(self.weather.wind_from_deg) + math.pi
        wind = self.weather.wind_mps
        fall_m_s = float(fall_speed_m_s(self.weather.rain_rate_mm_h))
        self.moves_m_s = wind * math.cos(towards), wind * math.sin(towards), fall_m_s

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS of the rain in each cell's resolution cell, m²."""
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
        return np.asarray(self.per_m * volume_m3)

    def range_rates(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Mean by wind, fall and the ownship; spread by both, by shear and by turbulence."""
        level = np.cos(cells.elevation_rad)
        sight = (
            level * np.cos(cells.azimuth_rad),
            level * np.sin(cells.azimuth_rad),
            -np.sin(cells.elevation_rad),
        )
        past = [rain - own for rain, own in zip(self.moves_m_s, own_m_s, strict=True)]
        mean = sum(part * along for part, along in zip(past, sight, strict=True))
        speed_m_s = np.sqrt(sum(part * part for part in past))
        # Rounding alone may put a rate beyond the speed that it is part of.
        rate = np.clip(mean, -speed_m_s, speed_m_s)
        platform = platform_spread_m_s(speed_m_s, rate, self.beam_rad[0])
        own = rain_spread_m_s(cells.range_m, cells.elevation_rad, self.beam_rad[1])
        return np.asarray(mean), np.hypot(own, platform)


class NoEcho(Echo):
    """Nothing."""

    def __call__(self, cells: Any) -> FloatArray:
        """Return 0 for each cell."""
        return np.zeros(len(cells))

    def range_rates(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Of nothing: those of the ground."""
        return ground_m_s, np.zeros(len(cells))


class SidelobeClutter(Effect):
    """Ground and rain at the target's range all around, heard through the sidelobes.

    All sidelobes have one mean level (``sidelobe_level_db``), towards the ground below as well:
    the altitude line is in it. Flown over, they have range rates of every direction, so that a
    moving-target filter takes little of them.
    """

    lockstep = True
    name = "sidelobe clutter"
    acts_on = "clutter"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``sidelobe_level_db``, and for ground or rain."""
        level_db = block.p.sidelobe_level_db
        if level_db is None:
            return Verdict(False, "sidelobe_level_db is not given")
        if not cell_size(block.p)[2]:
            return Verdict(False, "range_resolution_m is 0: no cell, no clutter in it")
        rain = _rain_rate(block) and block.wavelength_m is not None
        if terrain_of(block) is None and not rain:
            return Verdict(False, "there is neither [terrain] height_m nor rain")
        return Verdict(True, f"sidelobe_level_db is {level_db:g}")

    def build(self, block: Any) -> Echo:
        """Return what gives the RCS in the sidelobes, 0 where there is none."""
        return SidelobeEcho(block) if self.verdict(block).simulated else NoEcho(block)


class SidelobeEcho(Echo):
    """A ring of ground and a shell of rain, at the level of the sidelobes."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self.two_way = 10.0 ** (0.2 * block.p.sidelobe_level_db)
        self.weather = block.context.sections["weather"]
        self.per_m = 0.0
        if self.weather.rain_rate_mm_h and block.wavelength_m is not None:
            self.per_m = rain_reflectivity_of(block)

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS of ground and rain at each cell's range, m², below the sidelobes."""
        own_alt_m, step_m = cells.of_row("own_alt_m"), self.depth_m
        rcs = np.zeros(len(cells))
        lowest_m = -math.inf
        if self.terrain is not None:
            lowest_m = self.terrain.height_m
            rcs = rcs + ground_ring_rcs_m2(
                cells.range_m, height_above_terrain_m(own_alt_m, lowest_m),
                gamma_db=self.terrain.clutter_gamma_db, range_resolution_m=step_m,
            )  # fmt: skip
        if self.per_m:
            rcs = rcs + self.per_m * rain_shell_m3(
                cells.range_m, own_alt_m, range_resolution_m=step_m, lowest_m=lowest_m,
                highest_m=self.weather.rain_top_m,
            )  # fmt: skip
        return self.two_way * rcs

    def range_rates(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Around 0, with the deviation that a circle of directions gives the ownship's speed."""
        north, east, _ = own_m_s
        return np.zeros(len(cells)), np.sqrt(0.5 * (north * north + east * east))


class BoundaryClutter(GroundClutter):
    """The same for a range boundary, which hears the ground if its cells have a size."""

    lockstep = True

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[terrain] height_m``, and for a cell."""
        found = super().verdict(block)
        zero = [name for width, name in zip(cell_size(block.p), _CELL, strict=True) if not width]
        if found.simulated and zero:
            return Verdict(False, f"{zero[0]} is 0: no cell, no ground in it")
        return found

    def build(self, block: Any) -> Echo:
        """Return each cell's ground clutter; 0 where the verdict was that there is none."""
        if not self.verdict(block).simulated:
            return NoEcho(block)
        return super().build(block)


def no_rain_echo(block: Any) -> str:
    """Return why rain has no echo for a radar; empty where it has one."""
    if block.wavelength_m is None:
        return "frequency_hz is not given: how strongly drops scatter follows from it"
    for width, (beam, step) in zip(cell_size(block.p), CELL_SIZES, strict=True):
        if not width:
            return f"{step} is 0 and {beam} is not given: no cell, no rain in it"
    return ""


def rain_reflectivity_of(block: Any) -> float:
    """Return the RCS of a volume of the scene's rain as a radar receives it, 1/m."""
    per_m = float(rain_reflectivity_per_m(_rain_rate(block), block.wavelength_m))
    if block.p.polarisation == "circular":
        per_m *= 10.0 ** (-0.1 * block.p.rain_rejection_db)
    return per_m


def _rain_rate(block: Any) -> float:
    weather = block.context.sections.get("weather")
    return 0.0 if weather is None else float(weather.rain_rate_mm_h)


def beamwidths_rad(block: Any) -> tuple[float, float]:
    """Return a radar's beamwidths in azimuth and elevation, rad; by default its resolution."""
    azimuth_rad, elevation_rad, _ = cell_size(block.p)
    return azimuth_rad, elevation_rad


def terrain_of(block: Any) -> Any:
    """Return the terrain of a block's scene, or None where there is none."""
    terrain = block.context.sections.get("terrain")
    return None if terrain is None or terrain.height_m is None else terrain
