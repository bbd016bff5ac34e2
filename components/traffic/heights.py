"""What the altitudes of a scene or a file are: heights of either kind, or pressure altitudes."""

from typing import Any, Literal

from pydantic import Field

from components.atmosphere.pressure_altitude import Air
from dsa_des.block.component import Parameters


class Heights(Parameters):
    """States what flights' altitudes are: above the ellipsoid, above sea level, or pressure."""

    heights: Literal["geometric", "sea_level", "pressure"] = Field(
        default="geometric",
        description="What its altitudes are: heights above the ellipsoid; above mean sea level "
        "(`[terrain] geoid_undulation_m`); or pressure altitudes and flight levels, which are "
        "flown where the air of `[weather]` has these pressures at the start.",
    )

    def height_above_ellipsoid_m(self, air: Air | None, altitude_m: Any) -> Any:
        """Return heights above the ellipsoid, m, by `heights`; unchanged if `air` is None.

        None is the standard's, in which they are the same numbers.
        """
        if air is None or self.heights == "geometric":
            return altitude_m
        if self.heights == "pressure":
            return air.height_of_pressure_altitude_m(altitude_m)
        return altitude_m + air.geoid_m
