"""Parameters of what a radar does where it is cued."""

from typing import Any

from pydantic import Field

from components.sensor.parameters import SensorParameters


class CuedRadarParameters(SensorParameters):
    """What a radar does within a cue cone; its scan clock stays as it is."""

    cued_dwell_factor: float | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="Time on a beam within a cue cone, in times of the usual one, added up "
        "coherently: a factor of the SNR. By default as usual.",
    )
    cued_beam_first: bool = Field(
        default=False,
        description="Whether a sweeping beam visits cue cones as a scan begins, and then sweeps.",
    )


def dwell_factor(parameters: Any) -> Any:
    """Return the factor of each cell's SNR: that of the dwell where it is cued."""

    def factor(cells: Any) -> Any:
        if cells.cued is None:
            return 1.0
        return 1.0 + (parameters.cued_dwell_factor - 1.0) * cells.cued

    return factor
