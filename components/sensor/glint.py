"""Glint and wander of the centroid as an effect: where a target seems to be on itself.

An echo's or a picture's centre is not the aircraft's: it wanders over it, and beyond its edges now
and then, as the phases of its scatterers or the light on it change with the aspect.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.aircraft.aircraft import Aircraft, Roster
from components.aircraft.known_targets import offered_rosters
from components.geometry import body_angles, body_to_ned, ned_to_body, unit_vector
from components.messages.detections import LastingPart
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.time.gauss_markov import GaussMarkov

Place = tuple[FloatArray, FloatArray, FloatArray]
# Nearer to the vertical azimuths say nothing.
_LEAST_COS = 1e-3
_LEAST_AREA_M2 = 0.01


class Wander:
    """Shifts lines of sight by glint, and gives the variances that this adds."""

    def __init__(self, block: Any) -> None:
        self._share = block.p.glint_share
        self._lasts_s = block.p.glint_correlation_time_s
        self._process = GaussMarkov(block.stream("glint"), self._lasts_s)
        rosters = [one for one in offered_rosters(block.context) if len(one.extents_m)]
        rosters = rosters or [Roster.from_pairs([("", Aircraft())])]
        length2, span2, height2 = np.mean(
            np.concatenate([roster.extents_m for roster in rosters]) ** 2, axis=0
        ).tolist()
        #: Mean squares of the extent across and along a level line of sight, and upward, m².
        self._level2, self._upward2 = 0.5 * (length2 + span2), height2
        band = getattr(block, "areas", "") or "eo"
        shown = np.concatenate([_mean_horizontal_view_area_m2(roster, band) for roster in rosters])
        #: Area that shows on a level line of sight, from any side, m².
        self._area_m2 = max(float(np.mean(shown)), _LEAST_AREA_M2)

    def __call__(
        self,
        cells: Cells,
        detected: IntArray,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        range_m: FloatArray,
    ) -> Place:
        """Return where some cells' targets seem to be, in body axes, from where they are."""
        keys = cells.roster.draw_keys_of(cells.target[detected])
        when, run = cells.instant_ns[detected], cells.run[detected]
        extent_m = cells.roster.extents_m[cells.craft[detected]]
        length_m, span_m, height_m = (
            self._share * extent_m[:, axis] * self._process(keys, when, axis, run)
            for axis in range(3)
        )
        heading = cells.azimuth_rad[detected] + cells.relative_heading_rad[detected]
        north_east_down = body_to_ned(
            length_m,
            span_m,
            height_m,
            heading,
            cells.target_pitch_rad[detected],
            cells.target_roll_rad[detected],
        )
        yaw, pitch, roll = (angle[detected] for angle in cells.own_attitude)
        off = ned_to_body(*north_east_down, yaw, pitch, roll)
        along = unit_vector(azimuth_rad, elevation_rad)
        x, y, z = (range_m * to + by for to, by in zip(along, off, strict=True))
        azimuth, elevation = body_angles(x, y, z)
        return azimuth, elevation, np.sqrt(x * x + y * y + z * z)

    def correlated_parts_by_quantity(self) -> dict[str, list[LastingPart]]:
        """Return, by quantity (angles, range), the parts of glint correlated between looks."""
        share2, lasts_s = self._share**2, self._lasts_s
        return {
            "azimuth": [LastingPart(lasts_s=lasts_s, across_m2=share2 * self._level2)],
            "elevation": [LastingPart(lasts_s=lasts_s, across_m2=share2 * self._upward2)],
            "range": [LastingPart(share2 * self._level2, lasts_s)],
        }

    def added_variances_by_quantity(
        self,
        values: Mapping[str, FloatArray],
        signal: Mapping[str, FloatArray],
        pixel_rad: tuple[float, float] | None,
    ) -> dict[str, FloatArray]:
        """Return, by quantity, glint's variances (rad²; m² if range is measured) in sensor axes.

        `pixel_rad` is the width and height of a pixel of a sensor that measures a target's size
        instead of its range.
        """
        share2 = self._share**2
        level = np.maximum(np.cos(values["elevation"]), _LEAST_COS)
        if pixel_rad is None:
            over2 = values["range"] ** 2
            added = {
                "azimuth": share2 * self._level2 / (over2 * level**2),
                "elevation": share2 * self._upward2 / over2,
                "range": np.full(len(over2), share2 * self._level2),
            }
            return added
        # As wide and as high as the scene's aircraft are for the area that they show: a wing seen
        # from ahead is wide, and hardly an area.
        solid = signal["pixels"] * pixel_rad[0] * pixel_rad[1] / self._area_m2
        return {
            "azimuth": share2 * solid * self._level2 / level**2,
            "elevation": share2 * solid * self._upward2,
        }


APPARENT_PLACE = Hook("apparent place", Wander, "where targets seem to be")


class Glint(Effect[Wander]):
    """Targets seem to be where their centre of reflection is, which wanders over their extent.

    Along each of a target's own axes the centre is off by a Gauss-Markov process whose standard
    deviation is ``glint_share`` of the target's extent; so the error across the line of sight is
    that share of the extent that the sensor sees, over the range, and along it a range's. A sensor
    does not know its target: what it states is that of the scene's aircraft on average, level and
    from any side, at the range, or of the size, that it measures.
    """

    name = "glint"
    acts_on = APPARENT_PLACE
    builds = Wander
    outside_the_proof = "every target has an extent"

    def verdict(self, block: Any) -> Verdict:
        """Return whether glint is on, and why: ``errors`` from the signal, ``glint_share`` > 0."""
        share = getattr(block.p, "glint_share", None)
        if share is None:
            return Verdict(False, "its errors do not follow from signals")
        if block.p.errors != "signal":
            return Verdict(False, f"errors is {block.p.errors!r}")
        return Verdict(share > 0.0, f"glint_share is {share:g}")


def _mean_horizontal_view_area_m2(roster: Roster, band: str) -> FloatArray:
    """Return each aircraft's projected area, m², seen horizontally, averaged over headings."""
    front, side = (roster.column(f"{band}.{body}_m2") for body in ("front", "side"))
    if band == "ir":
        front = 0.5 * (front + roster.column("ir.back_m2"))
    return front + 2.0 / np.pi * side
