"""The area of an aircraft to an infrared camera: front, back and exhaust plume."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.known_targets import offered_rosters
from components.arguments.checks import (
    broadcast_flat,
    check_angle_rad,
    check_not_negative,
    unflatten,
)
from components.optical.silhouette import line_of_sight_in_target_axes, visible_area
from components.sensor.look import Cells, CellValues, aspect_pitch_roll_elevation_rad
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict

# Assumption: the plume seen from dead astern, as a share of the back area. Table 4.5 only ranks the
# engines: a propeller's airflow is cold, a turbofan mixes much cold with little hot air, a
# turbojet's is hot; §4.3.2 draws the same order.
PLUME_SHARE_OF_BACK = {"propeller": 0.0, "turbofan": 0.25, "turbojet": 1.0}


def plume_area(
    relative_heading_rad: ArrayLike,
    pitch_rad: ArrayLike,
    roll_rad: ArrayLike,
    elevation_rad: ArrayLike,
    *,
    back_m2: ArrayLike,
    engine: str,
    plume_share_of_back: ArrayLike | None = None,
) -> Any:
    """Return the hot exhaust plume's additional area, m², growing from nose to tail aspect.

    share · back · (1 + cos g)/2, with g the angle between the target's nose and the line of sight
    from us to it: 0 head-on, where the airframe hides the plume, half abeam, all of it from
    astern. The law and the shares are assumptions (the thesis gives the order of the engines and
    folds the plume into the areas of Tables 3.2 and 4.6).
    """
    if engine not in PLUME_SHARE_OF_BACK:
        raise ValueError(
            f"engine is {engine!r}: it must be one of {', '.join(PLUME_SHARE_OF_BACK)}"
        )
    share = PLUME_SHARE_OF_BACK[engine] if plume_share_of_back is None else plume_share_of_back
    shape, (heading, pitch, roll, elevation, back, shares) = broadcast_flat(
        relative_heading_rad=check_angle_rad("relative_heading_rad", relative_heading_rad),
        pitch_rad=check_angle_rad("pitch_rad", pitch_rad),
        roll_rad=check_angle_rad("roll_rad", roll_rad),
        elevation_rad=check_angle_rad("elevation_rad", elevation_rad),
        back_m2=check_not_negative("back_m2", back_m2),
        plume_share_of_back=check_not_negative("plume_share_of_back", share),
    )
    cos_off_nose, _, _, _ = line_of_sight_in_target_axes(heading, pitch, roll, elevation)
    return unflatten(shares * back * np.clip(0.5 + 0.5 * cos_off_nose, 0.0, 1.0), shape)


def infrared_area(
    relative_heading_rad: ArrayLike,
    pitch_rad: ArrayLike,
    roll_rad: ArrayLike,
    elevation_rad: ArrayLike,
    *,
    front_m2: ArrayLike,
    back_m2: ArrayLike,
    side_m2: ArrayLike,
    horizontal_m2: ArrayLike,
    engine: str | None = None,
    plume_share_of_back: ArrayLike | None = None,
    model: str = "exact",
    validate: bool = True,
) -> Any:
    """Return the area that radiates towards an infrared camera (thesis eq. 20-21).

    The silhouette with separate front and back, plus the plume if an engine is named. Without an
    engine this is the thesis's model, whose tables already hold the doubled back (errata 23c):
    naming an engine adds to it, so pair it with a back that is not doubled.
    """
    area = visible_area(
        relative_heading_rad,
        pitch_rad,
        roll_rad,
        elevation_rad,
        front_m2=front_m2,
        side_m2=side_m2,
        horizontal_m2=horizontal_m2,
        back_m2=back_m2,
        model=model,
        validate=validate,
    )
    if engine is None:
        if plume_share_of_back is not None:
            raise ValueError("engine is None: it must be named for plume_share_of_back to be used")
        return area
    return area + plume_area(
        relative_heading_rad,
        pitch_rad,
        roll_rad,
        elevation_rad,
        back_m2=back_m2,
        engine=engine,
        plume_share_of_back=plume_share_of_back,
    )


AREA = Hook("area", CellValues, "area in m² to add to each cell's")


class Plume(Effect[CellValues]):
    """Each aircraft's exhaust plume by its engine; those without one are not computed."""

    name = "plume"
    acts_on = AREA

    def verdict(self, block: Any) -> Verdict:
        """Return whether plumes radiate: needs ``plume``, and a target whose engine has one."""
        if not block.p.plume:
            return Verdict(False, "plume is false")
        rosters = offered_rosters(block.context)
        if not rosters:
            return Verdict(True, "plume is true and the targets are not known before the run")
        for roster in rosters:
            for name, engine in zip(roster.names, roster.propulsion_types.tolist(), strict=True):
                if PLUME_SHARE_OF_BACK[engine] > 0.0:
                    return Verdict(True, f"plume is true and {name!r} has a {engine}")
        return Verdict(False, "plume is true, but no target's engine has one")

    def build(self, block: Any) -> CellValues:
        """Return a function that gives the plume's area to add in each cell, m²."""
        scale = 1.0 if block.p.plume else 0.0
        shares = {engine: scale * share for engine, share in PLUME_SHARE_OF_BACK.items()}

        def added(cells: Cells) -> FloatArray:
            engines = cells.column_at_targets(cells.roster.propulsion_types)
            back = cells.column_at_targets(cells.roster.column("ir.back_m2"))
            area = np.zeros(len(cells))
            for engine in np.unique(engines).tolist():
                if PLUME_SHARE_OF_BACK[engine] == 0.0:
                    continue
                chosen = np.flatnonzero(engines == engine)
                area[chosen] = plume_area(
                    *aspect_pitch_roll_elevation_rad(cells, chosen),
                    back_m2=back[chosen],
                    engine=engine,
                    plume_share_of_back=shares[engine],
                )
            return area

        return added
