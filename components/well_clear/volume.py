"""Volumes around an aircraft, with every size free, and those of the standards by name."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

FOOT_M = 0.3048
NAUTICAL_MILE_M = 1852.0

#: How time enters the horizontal condition.
TIME_VARIABLES = ("modified_tau", "time_to_closest", "time_to_entry", "none")


@dataclass(frozen=True)
class Volume:
    """A volume that is violated horizontally and vertically at once.

    Horizontally: the range is at most `horizontal_m`, or the aircraft will pass within it and the
    time variable lies in [0, `horizontal_time_s`]. Vertically: the height difference is at most
    `vertical_m`, or the aircraft approach each other and are level within `vertical_time_s`.

    Parameters
    ----------
    horizontal_m, vertical_m : float
        Above 0, m.
    horizontal_time_s, vertical_time_s : float
        Not negative, s; 0 leaves the sizes alone.
    time_variable : {"modified_tau", "time_to_closest", "time_to_entry", "none"}

    Raises
    ------
    ValueError
        Naming the size, its value and what is allowed.

    Notes
    -----
    C. Muñoz, A. Narkawicz, J. Chamberlain et al., "A family of well-clear boundary models for the
    integration of UAS in the NAS", AIAA Aviation 2014.
    """

    horizontal_m: float
    vertical_m: float
    horizontal_time_s: float = 0.0
    vertical_time_s: float = 0.0
    time_variable: str = "modified_tau"

    def __post_init__(self) -> None:
        """Refuse sizes that mean nothing."""
        for name in ("horizontal_m", "vertical_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value}: it must be finite and above 0")
        for name in ("horizontal_time_s", "vertical_time_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} is {value}: it must be finite and not negative")
        if self.time_variable not in TIME_VARIABLES:
            raise ValueError(
                f"time_variable is {self.time_variable!r}: it must be one of "
                f"{', '.join(TIME_VARIABLES)}"
            )


#: The volumes of RTCA DO-365B, of ASTM F3442 and of a near mid-air collision.
PRESETS: Mapping[str, Volume] = MappingProxyType(
    {
        "do365_en_route": Volume(0.66 * NAUTICAL_MILE_M, 450 * FOOT_M, 35.0),
        "do365_preventive": Volume(0.66 * NAUTICAL_MILE_M, 700 * FOOT_M, 35.0),
        "do365_terminal": Volume(1500 * FOOT_M, 450 * FOOT_M, time_variable="none"),
        "do365_non_cooperative": Volume(2200 * FOOT_M, 450 * FOOT_M, time_variable="none"),
        "astm_f3442": Volume(2000 * FOOT_M, 250 * FOOT_M, time_variable="none"),
        "nmac": Volume(500 * FOOT_M, 100 * FOOT_M, time_variable="none"),
    }
)
