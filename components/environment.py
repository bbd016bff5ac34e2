"""Tables of a scene that all blocks can read: ``[weather]`` and ``[accuracy]``."""

from pydantic import Field

from dsa_des.component import Parameters


class Weather(Parameters):
    """The weather; by default there is none, and sensors look through empty space."""

    gas: bool = Field(
        default=False, description="Whether oxygen and water vapour attenuate radar (P.676)."
    )
    vapour_density_g_m3: float = Field(
        default=7.5, ge=0, le=50, description="Water vapour density at sea level, g/m³."
    )
    rain_rate_mm_h: float = Field(default=0.0, ge=0, le=300, description="Rain rate, mm/h.")
    rain_top_m: float = Field(
        default=2668.0, description="Altitude of the rain's upper edge, m (ITU-R P.839-4)."
    )
    fog_water_g_m3: float = Field(
        default=0.0, ge=0, le=10, description="Liquid water of fog or cloud, g/m³."
    )
    fog_base_m: float = Field(default=-1000.0, description="Altitude of the fog's lower edge, m.")
    fog_top_m: float = Field(default=500.0, description="Altitude of the fog's upper edge, m.")
    fog_temperature_c: float = Field(
        default=10.0, ge=-40, le=50, description="Temperature of the fog's droplets, deg C."
    )
    visibility_km: float | None = Field(
        default=None,
        gt=0,
        description="Visibility (Koschmieder, 2 % contrast), km; by default from fog and rain.",
    )


class Accuracy(Parameters):
    """Errors that a scene allows; effects and rungs proven to stay within them are left out."""

    detection_probability: float | None = Field(
        default=None, gt=0, lt=1, description="Error of any probability of detection."
    )
    angle_deg: float | None = Field(default=None, gt=0, description="Error of any angle, deg.")
    range_m: float | None = Field(default=None, gt=0, description="Error of any range, m.")
