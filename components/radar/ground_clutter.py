"""The echo of the ground in the cell of a target, over flat terrain of one altitude."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_numbers,
    check_positive,
    refuse,
    unflatten,
)
from components.radar.resolution import cell_azimuth_elevation_range
from components.sensor.look import Cells
from components.terrain.reflection import reflection_coefficient
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict

# Ground farther from the beam's axis than this many beamwidths (two-way gain below -96 dB) is dark.
BEAM_REACH_BEAMWIDTHS = 2.0

_LN_2 = math.log(2.0)


def height_above_terrain_m(own_alt_m: ArrayLike, terrain_alt_m: ArrayLike) -> Any:
    """Return the height above terrain, m; raise ValueError if it is not above 0."""
    shape, (own, terrain) = broadcast_flat(
        own_alt_m=check_finite("own_alt_m", own_alt_m),
        terrain_alt_m=check_finite("terrain_alt_m", terrain_alt_m),
    )
    buried = terrain >= own
    if buried.any():
        first = int(np.argmax(buried))
        raise ValueError(
            f"terrain_alt_m is {terrain[first]:g}: it must be below the ownship's altitude, "
            f"{own[first]:g} m"
        )
    return unflatten(own - terrain, shape)


def ground_clutter_rcs_m2(
    range_m: ArrayLike,
    elevation_rad: ArrayLike,
    height_m: ArrayLike,
    *,
    gamma_db: float,
    azimuth_beamwidth_rad: float,
    elevation_beamwidth_rad: float,
    range_resolution_m: float,
) -> Any:
    """Return the ground's RCS in the cell at each slant range, for a beam's elevation, m².

    `gamma_db` is the reflectivity γ of σ0 = γ sin(grazing): about -20 for a smooth desert or sea,
    -15 for farmland, -10 for woodland and -5 for a town, with ±5 dB between places. Beamwidths are
    one-way half-power ones. The RCS goes into the radar equation as the target's, the beam's gain
    towards the ground included; it is 0 where the cell holds no ground (nearer than the height) or
    the ground is more than `BEAM_REACH_BEAMWIDTHS` beamwidths off the axis.

    σ = σ0 · A · g: constant-γ reflectivity (D. K. Barton, "Land clutter models for radar design and
    analysis", Proc. IEEE 73(2), 1985); patch A = R θ_az · min(ΔR / cos ψ, R θ_el / sin ψ), limited
    by the range cell or, looking steeply down, by the beam; two-way gain of a Gaussian beam g =
    exp(-8 ln 2 (Δ/θ_el)²), Δ between the beam's axis and the ground at that range. Sidelobes
    (`ground_ring_rcs_m2`) are left out, and the spread of the ground's depression over the patch.
    """
    for name, value in (
        ("azimuth_beamwidth_rad", azimuth_beamwidth_rad),
        ("elevation_beamwidth_rad", elevation_beamwidth_rad),
        ("range_resolution_m", range_resolution_m),
    ):
        check_positive(name, value)
    reflectivity = check_numbers("gamma_db", gamma_db)
    refuse("gamma_db", reflectivity, ~(np.abs(reflectivity) <= 100.0), "lie in ±100 dB")
    shape, (distance, elevation, height) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        elevation_rad=check_finite("elevation_rad", elevation_rad),
        height_m=check_positive("height_m", height_m),
    )
    sine = np.minimum(height, distance) / _distance_or_height(distance, height)
    grazing = np.arcsin(sine)
    off_axis = (elevation + grazing) / elevation_beamwidth_rad
    lit = (distance >= height) & (np.abs(off_axis) <= BEAM_REACH_BEAMWIDTHS)
    off_axis = np.where(lit, off_axis, 0.0)
    # Looking straight down cos ψ is 0: the beam limits the patch there, so any floor does.
    cosine = np.maximum(np.cos(grazing), 1e-12)
    across = distance * azimuth_beamwidth_rad
    along = np.minimum(
        range_resolution_m / cosine, distance * elevation_beamwidth_rad / np.maximum(sine, 1e-300)
    )
    gain = np.exp(-8.0 * _LN_2 * off_axis * off_axis)
    rcs = 10.0 ** (0.1 * float(reflectivity)) * sine * across * along * gain
    return unflatten(np.where(lit, rcs, 0.0), shape)


def ground_ring_rcs_m2(
    range_m: ArrayLike, height_m: ArrayLike, *, gamma_db: float, range_resolution_m: float
) -> Any:
    """Return the RCS of a ring of ground at a slant range all around, as sidelobes see it, m².

    σ0 2 pi R ΔR, before any gain: on flat ground the ring at slant range R has that area whatever
    the height. 0 nearer than the height.
    """
    check_positive("range_resolution_m", range_resolution_m)
    shape, (distance, height) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        height_m=check_positive("height_m", height_m),
    )
    sine = np.minimum(height, distance) / _distance_or_height(distance, height)
    area = 2.0 * math.pi * distance * range_resolution_m
    rcs = 10.0 ** (0.1 * float(gamma_db)) * sine * area
    return unflatten(np.where(distance >= height, rcs, 0.0), shape)


def altitude_line_rcs_m2(
    range_m: ArrayLike,
    height_m: ArrayLike,
    *,
    range_resolution_m: float,
    slope_rad: float,
    reflectivity: float,
) -> Any:
    """Return the altitude line's RCS (specular ground below) in a slant range's cell, m².

    Facets that lie level mirror what comes from straight above: σ0 = ρ² / tan² β0 · exp(-tan² θ /
    tan² β0) at an angle θ from the vertical, of facets whose slopes have tan β0 (the
    quasi-specular form of D. K. Barton, "Land clutter models for radar design and analysis", Proc.
    IEEE 73(2), 1985), ρ² being the `reflectivity` of power straight down. Over a cell's ring of
    flat ground that is pi h² ρ² (exp(-a) - exp(-b)), with a and b = (R² - h²) / (h tan β0)² at its
    edges; over all of it pi h² ρ², the RCS of a mirror below whatever its roughness.
    """
    shape, (distance, height) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        height_m=check_positive("height_m", height_m),
    )
    half_m = 0.5 * float(check_positive("range_resolution_m", range_resolution_m))
    slope_m = height * math.tan(slope_rad)
    edges = (np.maximum(distance + side * half_m, height) for side in (-1.0, 1.0))
    near, far = ((edge - height) * (edge + height) / slope_m**2 for edge in edges)
    with np.errstate(under="ignore"):
        share = np.exp(-near) - np.exp(-far)
    return unflatten(math.pi * height**2 * reflectivity * share, shape)


def _distance_or_height(distance: Any, height: Any) -> Any:
    """Return the distance, or the height where the distance is 0 (no division by 0)."""
    return np.where(distance > 0.0, distance, height)


Velocity = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Clutter:
    """Each cell's clutter-to-noise ratios: the beam's ground (`mean`), and diffuse clutter.

    Diffuse is what is more noise: rain, and what sidelobes meet.
    """

    mean: FloatArray
    diffuse: FloatArray

    @classmethod
    def sum_echoes(
        cls, echoes: Sequence[Echo], powers: Iterable[FloatArray], cells: int
    ) -> Clutter:
        """Return the sums of the echoes' powers over noise, diffuse ones apart from others."""
        mean, diffuse = np.zeros(cells), np.zeros(cells)
        for echo, power in zip(echoes, powers, strict=True):
            if echo.diffuse:
                diffuse = diffuse + power
            else:
                mean = mean + power
        return cls(mean, diffuse)

    @property
    def total(self) -> FloatArray:
        """Mean and diffuse clutter added."""
        return self.mean + self.diffuse

    def take(self, cells: Any) -> Clutter:
        """Return the clutter of the selected cells."""
        return Clutter(self.mean[cells], self.diffuse[cells])


class Echo:
    """A source of clutter in the target's cell; called with cells, it returns its RCS in m²."""

    #: Whether it adds to noise; else it is the mean that ``clutter_mean`` speaks of.
    diffuse = True

    def __init__(self, block: Any) -> None:
        self.block = block
        self.terrain = terrain_of(block)
        *self.beam_rad, self.depth_m = cell_azimuth_elevation_range(block.p)

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS in each cell's resolution cell, m²."""
        raise NotImplementedError

    def range_rate_mean_and_spread(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation of the clutter's range rate in each cell, m/s.

        `own_m_s` is the ownship's velocity over ground, `ground_m_s` the range rate of the ground
        on the beam's axis.
        """
        raise NotImplementedError


def scene_altitude_line_rcs_m2(block: Any, range_m: FloatArray, height_m: FloatArray) -> FloatArray:
    """Return the altitude line's RCS for the scene's terrain, m²; 0 without a facet slope."""
    terrain = terrain_of(block)
    if terrain.facet_slope_deg is None:
        return np.zeros(len(range_m))
    down = reflection_coefficient(
        0.5 * math.pi, terrain.permittivity(block.wavelength_m), "horizontal"
    )
    rcs = altitude_line_rcs_m2(
        range_m,
        height_m,
        range_resolution_m=cell_azimuth_elevation_range(block.p)[2],
        slope_rad=math.radians(terrain.facet_slope_deg),
        reflectivity=abs(down) ** 2,
    )
    return np.asarray(rcs)


class GroundEcho(Echo):
    """The patch of ground that beam and range cell share."""

    diffuse = False

    def __init__(self, block: Any, terrain: Any) -> None:
        super().__init__(block)
        self.terrain = terrain

    def __call__(self, cells: Any) -> FloatArray:
        """Return the RCS of the ground in each cell's resolution cell, m²."""
        height_m = height_above_terrain_m(cells.field_at_rows("own_alt_m"), self.terrain.height_m)
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

    def range_rate_mean_and_spread(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return cells' ground range rate, and its spread by beamwidth and ground motion, m/s."""
        speed_m_s = np.sqrt(sum(part * part for part in own_m_s))
        platform = platform_range_rate_spread_m_s(speed_m_s, ground_m_s, self.beam_rad[0])
        return ground_m_s, np.hypot(self.terrain.clutter_motion_m_s, platform)


class NoEcho(Echo):
    """Clutter of zero power."""

    def __call__(self, cells: Any) -> FloatArray:
        """Return 0 for each cell."""
        return np.zeros(len(cells))

    def range_rate_mean_and_spread(
        self, cells: Cells, own_m_s: Velocity, ground_m_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the ground's range rate and a spread of 0 in each cell, m/s."""
        return ground_m_s, np.zeros(len(cells))


CLUTTER = Hook("clutter", Echo, "RCS in m² of what else echoes in each cell's resolution cell")


class GroundClutter(Effect[Echo]):
    """Echo of flat terrain in the cell of each target, where the beam meets it.

    The beam points at the target and is as wide as a resolution cell, unless the scene gives its
    beamwidths; clutter more than two beamwidths off its axis is 0. A range boundary whose cells
    have no size has none. The air takes from the echo of the ground what it takes from the
    target's. What the threshold does there is said by ``clutter_threshold``.
    """

    name = "ground clutter"
    acts_on = CLUTTER

    def verdict(self, block: Any) -> Verdict:
        """Return whether ground clutter is simulated: needs ``[terrain] height_m``."""
        terrain = terrain_of(block)
        if terrain is None:
            return Verdict(False, "[terrain] height_m is not given")
        if block.boundary and block.p.zero_steps_without_beamwidth:
            return Verdict(
                False, f"{block.p.zero_steps_without_beamwidth[0]} is 0: no cell, no ground in it"
            )
        return Verdict(True, f"[terrain] height_m is {terrain.height_m:g}")

    def build(self, block: Any) -> Echo:
        """Return the ground's echo; one of zero power where ground clutter is not simulated."""
        terrain = terrain_of(block)
        if not self.verdict(block).simulated:
            return NoEcho(block)
        if block.p.zero_steps_without_beamwidth:
            raise ValueError(
                f"{block.p.zero_steps_without_beamwidth[0]} is 0: ground clutter fills a "
                f"resolution cell, it "
                "must be above 0"
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


def terrain_of(block: Any) -> Any:
    """Return the ``[terrain]`` of a block's scene; None if it is missing or has no height_m."""
    terrain = block.context.sections.get("terrain")
    return None if terrain is None or terrain.height_m is None else terrain


#: Standard deviation over half-power width of a Gaussian beam's two-way pattern.
_BEAM_DEVIATION = 1.0 / math.sqrt(16.0 * math.log(2.0))


def platform_range_rate_spread_m_s(
    speed_m_s: ArrayLike, ground_rate_m_s: ArrayLike, beamwidth_rad: float
) -> Any:
    """Return the standard deviation of the ground's range rates over a moving radar's beam, m/s.

    `ground_rate_m_s` is that of the ground on the beam's axis, -speed · cos(angle off the flight's
    course). The result is 0.30 · speed · beamwidth · sin(angle), as a frequency 0.60 · speed ·
    beamwidth / λ abeam: a Gaussian beam, seen twice, has the standard deviation beamwidth / sqrt(16
    ln 2). Straight ahead the spread is of second order in the beamwidth and left out.
    """
    check_positive("beamwidth_rad", beamwidth_rad)
    shape, (speed, rate) = broadcast_flat(
        speed_m_s=check_not_negative("speed_m_s", speed_m_s),
        ground_rate_m_s=check_finite("ground_rate_m_s", ground_rate_m_s),
    )
    across = np.sqrt(np.maximum((speed - rate) * (speed + rate), 0.0))
    return unflatten(_BEAM_DEVIATION * float(beamwidth_rad) * across, shape)


def clutter_as_signal_warnings(parameters: Any, terrain: Any) -> list[str]:
    """Return a warning in a list if clutter counts as signal: threshold at the noise level."""
    if terrain is None or parameters.clutter_threshold != "noise":
        return []
    return [
        "clutter_threshold is 'noise': the echo of the ground counts as signal, so that clutter "
        "raises detections; 'adaptive' keeps the probability of false alarm"
    ]
