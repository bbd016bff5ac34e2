"""Rain clutter, and clutter of rain and ground all around that sidelobes receive."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_not_negative,
    check_numbers,
    finite,
    positive,
    refuse,
    unflatten,
)
from components.radar.ground_clutter import (
    CLUTTER,
    Echo,
    NoEcho,
    Velocity,
    ground_ring_rcs_m2,
    height_above_terrain_m,
    platform_spread_m_s,
    terrain_of,
)
from components.radar.resolution import CELL_SIZES, cell_size
from components.sensor.look import Cells
from components.sensor.weather_cells import cells_verdict, on_the_way, weather_cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict

#: Drops are small against the wavelength, and scatter after Rayleigh, up to here.
HIGHEST_RAYLEIGH_HZ = 35.5e9
#: |K|² of water at centimetre waves.
DIELECTRIC_FACTOR = 0.93

_LN_2 = math.log(2.0)
# Wind shear (4 m/s per km, at most 6 m/s), turbulence and the spread of drops' fall speeds.
_SHEAR_PER_S, _MOST_SHEAR_M_S, _TURBULENCE_M_S, _FALL_SPREAD_M_S = 4e-3, 6.0, 1.0, 1.0


def rain_reflectivity_per_m(rain_rate_mm_h: ArrayLike, wavelength_m: float) -> Any:
    """Return the radar cross-section of a volume of rain, η in m² per m³.

    η = pi⁵ |K|² Z / λ⁴ with Z = 200 R^1.6 mm⁶/m³ (J. S. Marshall and W. M. Palmer, J. Meteorology
    5, 1948; M. I. Skolnik, Introduction to Radar Systems, 3rd ed., section 7.6; F. E. Nathanson,
    Radar Design Principles, 2nd ed., chapter 6). Drops scatter after Rayleigh: up to
    `HIGHEST_RAYLEIGH_HZ`, and there within 4 dB of spheres after Mie up to 25 mm/h; above, η is too
    large (12 dB at 94 GHz and 4 mm/h).
    """
    rate = check_not_negative("rain_rate_mm_h", rain_rate_mm_h)
    wave = float(positive("wavelength_m", wavelength_m))
    z_m3 = 200e-18 * rate**1.6
    return (math.pi**5 * DIELECTRIC_FACTOR / wave**4 * z_m3)[()]


def rain_volume_m3(
    range_m: ArrayLike,
    elevation_rad: ArrayLike,
    alt_m: ArrayLike,
    *,
    azimuth_beamwidth_rad: float,
    elevation_beamwidth_rad: float,
    range_resolution_m: float,
    lowest_m: float,
    highest_m: float,
) -> Any:
    """Return the volume of rain in the range cell of a target at which the beam points, m³.

    Weighted by the two-way gain of a beam of one-way half-power widths, as rain counts beside a
    target amid the beam. It rains from `lowest_m` (-inf for rain that nothing ends below) to
    `highest_m`.

    pi R² θ_az θ_el ΔR / (8 ln 2) of a Gaussian beam (J. R. Probert-Jones, Quart. J. Royal Met. Soc.
    88, 1962), times the share of its two-way gain that lies where it rains: over the height it is
    Gaussian with R cos(elevation) θ_el / sqrt(16 ln 2).
    """
    for name, value in (
        ("azimuth_beamwidth_rad", azimuth_beamwidth_rad),
        ("elevation_beamwidth_rad", elevation_beamwidth_rad),
        ("range_resolution_m", range_resolution_m),
    ):
        positive(name, value)
    shape, (distance, elevation, height) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        elevation_rad=finite("elevation_rad", elevation_rad),
        alt_m=finite("alt_m", alt_m),
    )
    solid = math.pi * azimuth_beamwidth_rad * elevation_beamwidth_rad / (8.0 * _LN_2)
    spread = distance * np.cos(elevation) * elevation_beamwidth_rad / math.sqrt(16.0 * _LN_2)
    spread = np.maximum(spread, 1e-9)
    share = _normal_share_below((highest_m - height) / spread) - _normal_share_below(
        (lowest_m - height) / spread
    )
    volume = distance * distance * solid * range_resolution_m * np.maximum(share, 0.0)
    return unflatten(volume, shape)


def rain_shell_m3(
    range_m: ArrayLike,
    own_alt_m: ArrayLike,
    *,
    range_resolution_m: float,
    lowest_m: float,
    highest_m: float,
) -> Any:
    """Return the volume of rain at a slant range in all directions, which sidelobes meet, m³.

    2 pi R ΔR times the height of the shell in which it rains (Archimedes).
    """
    positive("range_resolution_m", range_resolution_m)
    shape, (distance, own) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m), own_alt_m=finite("own_alt_m", own_alt_m)
    )
    top = np.clip(highest_m - own, -distance, distance)
    bottom = np.clip(lowest_m - own, -distance, distance)
    height = np.maximum(top - bottom, 0.0)
    return unflatten(2.0 * math.pi * distance * range_resolution_m * height, shape)


def fall_speed_m_s(rain_rate_mm_h: ArrayLike) -> Any:
    """Return how fast rain falls as a radar sees it, m/s: 2.6 Z^0.107 (J. Joss, 1970)."""
    rate = check_numbers("rain_rate_mm_h", rain_rate_mm_h)
    refuse("rain_rate_mm_h", rate, ~(rate >= 0.0), "be 0 or more")
    return (2.6 * (200.0 * rate**1.6) ** 0.107)[()]


def rain_spread_m_s(
    range_m: ArrayLike, elevation_rad: ArrayLike, elevation_beamwidth_rad: float
) -> Any:
    """Return the standard deviation of the rain's own range rates in a cell, m/s.

    Shear of the wind over the beam's height, 0.42 · 4 m/s/km · R · θ_el and at most 6 m/s,
    turbulence of 1 m/s and 1 m/s · sin(elevation) of the drops' fall (Nathanson, chapter 6).
    """
    shape, (distance, elevation) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        elevation_rad=finite("elevation_rad", elevation_rad),
    )
    shear = 0.42 * _SHEAR_PER_S * elevation_beamwidth_rad * distance * np.cos(elevation)
    shear = np.minimum(shear, _MOST_SHEAR_M_S)
    fall = _FALL_SPREAD_M_S * np.sin(elevation)
    return unflatten(np.sqrt(shear**2 + _TURBULENCE_M_S**2 + fall**2), shape)


def _normal_share_below(deviations: FloatArray) -> FloatArray:
    """Return the share of a normal distribution that lies so many deviations above it or lower."""
    from scipy.special import ndtr

    share: FloatArray = ndtr(deviations)
    return share


class RainClutter(Effect[Echo]):
    """Echo of rain in the resolution cell of each target, as far as it rains there.

    In a cell of ``[weather] cells`` it rains as it does there and everywhere together.

    The beam points at the target. Drops scatter after Rayleigh, by the rain rate (Z = 200 R^1.6);
    the air and the rain on the way take from their echo what they take from the target's. It
    fluctuates like noise from pulse to pulse. It moves with the wind and falls.
    """

    name = "rain echo"
    acts_on = CLUTTER

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[weather] rain_rate_mm_h``, and for a carrier and a cell."""
        rate = _rain_rate(block)
        because = f"[weather] rain_rate_mm_h is {rate:g}"
        somewhere = Verdict(False, "")
        if any(one.rain_rate_mm_h for one in weather_cells(block)):
            somewhere = cells_verdict(block)
            because = because if rate else somewhere.because
        if (rate or somewhere.simulated) and (why := no_rain_echo(block)):
            return Verdict(False, why)
        return Verdict(rate > 0 or somewhere.simulated, because)

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
        self.per_m = float(rain_reflectivity_of(block, _rain_rate(block)))
        self.lowest_m = -math.inf if self.terrain is None else self.terrain.height_m
        towards = math.radians(self.weather.wind_from_deg) + math.pi
        wind = self.weather.wind_mps
        fall_m_s = float(fall_speed_m_s(self.weather.rain_rate_mm_h))
        self.moves_m_s = wind * math.cos(towards), wind * math.sin(towards), fall_m_s
        self._somewhere = any(one.rain_rate_mm_h for one in weather_cells(block))

    def rate_mm_h(self, cells: Cells) -> FloatArray:
        """Return how strongly it rains at each target."""
        rate = np.full(len(cells), float(self.weather.rain_rate_mm_h))
        for one, within in on_the_way(self.block, cells):
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
        *wind, fall = self.moves_m_s
        if self._somewhere:
            fall = fall_speed_m_s(self.rate_mm_h(cells))
        past = [rain - own for rain, own in zip((*wind, fall), own_m_s, strict=True)]
        mean = sum(part * along for part, along in zip(past, sight, strict=True))
        speed_m_s = np.sqrt(sum(part * part for part in past))
        # Rounding alone may put a rate beyond the speed that it is part of.
        rate = np.clip(mean, -speed_m_s, speed_m_s)
        platform = platform_spread_m_s(speed_m_s, rate, self.beam_rad[0])
        own = rain_spread_m_s(cells.range_m, cells.elevation_rad, self.beam_rad[1])
        return np.asarray(mean), np.hypot(own, platform)


class SidelobeClutter(Effect[Echo]):
    """Ground and rain at the target's range all around, received through the sidelobes.

    All sidelobes have one mean level (``sidelobe_level_db``), towards the ground below as well:
    the altitude line is in it. Flown over, they have range rates of every direction, so that a
    moving-target filter takes little of them.
    """

    name = "sidelobe clutter"
    acts_on = CLUTTER

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
            self.per_m = float(rain_reflectivity_of(block, _rain_rate(block)))

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


def no_rain_echo(block: Any) -> str:
    """Return why rain has no echo for a radar; empty where it has one."""
    if block.wavelength_m is None:
        return "frequency_hz is not given: how strongly drops scatter follows from it"
    for width, (beam, step) in zip(cell_size(block.p), CELL_SIZES, strict=True):
        if not width:
            return f"{step} is 0 and {beam} is not given: no cell, no rain in it"
    return ""


def rain_reflectivity_of(block: Any, rate_mm_h: ArrayLike) -> Any:
    """Return the RCS of a volume of rain as a radar receives it, 1/m."""
    per_m = rain_reflectivity_per_m(rate_mm_h, block.wavelength_m)
    if block.p.polarisation == "circular":
        per_m *= 10.0 ** (-0.1 * block.p.rain_rejection_db)
    return per_m


def _rain_rate(block: Any) -> float:
    weather = block.context.sections.get("weather")
    return 0.0 if weather is None else float(weather.rain_rate_mm_h)
