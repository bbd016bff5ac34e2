"""Eq. 33-34: what an error in the visible area does to the detection range."""

from pathlib import Path

import numpy as np

from components.optical.signature import detection_range
from components.thesis.basis import predicted
from components.thesis.made import Made, Picture
from components.thesis.plotting import BLUE, GREY, ORANGE, panels
from components.thesis.printed import printed
from components.thesis.project_files import aircraft, eo_camera
from components.thesis.row import Row


def make() -> Made:
    """Return the error in range of a 20 % error in area, over range."""
    camera = eo_camera()
    pixel = camera.pixel_azimuth_rad * camera.pixel_elevation_rad
    weight = camera.p.static_weight / camera.p.threshold

    def range_km(area_m2: float) -> float:
        return float(detection_range(area_m2, pixel_azimuth_rad=camera.pixel_azimuth_rad,
                                     pixel_elevation_rad=camera.pixel_elevation_rad,
                                     static_weight=weight)) / 1000.0  # fmt: skip

    def error_m(area_m2: float, share: float) -> float:
        return 1000.0 * (range_km(area_m2 * (1.0 + share)) - range_km(area_m2))

    head_on, large = aircraft("king_air").eo.front_m2, aircraft("boeing_787").eo.front_m2
    root = "Range goes with the square root of the area."
    camera_words = "Table 2.5's pixels and Table 4.4's areas; P of Table 4.4"
    inputs = (
        "sensors/afrl_eo.toml:azimuth_deg",
        "aircraft/king_air.toml:eo.front_m2",
        "aircraft/boeing_787.toml:eo.front_m2",
    )
    ranges = predicted(camera_words, *inputs)
    shape = predicted("eq. 15 alone: range goes with the square root of the area")
    everywhere = "it is 600 m at a detection range of 6.29 km only (errata 26)"
    relative = "the range goes with the square root of the area, whatever the range (errata 26)"
    denominator = "1 to 3 m² mean 1.8 to 3.1 km, nearer than any detection of Table 4.4 (errata 26)"
    rows = [
        Row(f"error in range for +20 % area, {name}", error_m(area, 0.2), "m",
            f'{root} "Approximately" 600 m, "for all detection ranges": 50 m are allowed for.',
            printed("eq-34", "error_m"), 50.0, everywhere, ranges)
        for name, area in (
            (f"nearest detection of Table 4.4, {range_km(head_on):.2f} km", head_on),
            (f"farthest, {range_km(large):.2f} km", large),
        )
    ]  # fmt: skip
    rows += [
        Row("detection range at which +20 % area are 600 m", 0.6 / (np.sqrt(1.2) - 1.0), "km",
            f"{root} Any range agrees somewhere; this is where."),
        Row("error in range for +20 % area, smallest", 100.0 * (np.sqrt(1.2) - 1.0), "%", "",
            printed("eq-34", "low_share"), None, relative, shape),
        Row("error in range for -20 % area, largest magnitude", 100.0 * (1.0 - np.sqrt(0.8)), "%",
            "", printed("eq-34", "high_share"), None, relative, shape),
        Row("denominator of eq. 34 at the threshold, smallest of Table 4.4",
            1e6 * range_km(head_on) ** 2 * pixel, "m²", "R²·σ_h·σ_v at the detection range: a·x.",
            printed("eq-34", "low"), None, denominator, ranges),
        Row("denominator of eq. 34 at the threshold, largest of Table 4.4",
            1e6 * range_km(large) ** 2 * pixel, "m²", "R²·σ_h·σ_v at the detection range: a·x.",
            printed("eq-34", "high"), None, denominator, ranges),
    ]  # fmt: skip
    at_km = np.linspace(1.0, 10.0, 181)
    more, less = 1000.0 * at_km * (np.sqrt(1.2) - 1.0), 1000.0 * at_km * (1.0 - np.sqrt(0.8))

    def draw(path: Path) -> None:
        with panels(path) as (axes,):
            axes.plot(at_km, more, color=BLUE, label="area 20 % too large: range too long by")
            axes.plot(at_km, less, "--", color=ORANGE,
                      label="area 20 % too small: range too short by")  # fmt: skip
            axes.axhline(600.0, color=GREY, linewidth=0.9, label="thesis: about 600 m everywhere")
            axes.set_xlabel("detection range without the error [km]")
            axes.set_ylabel("error in detection range [m]")
            axes.set(xlim=(1, 10), ylim=(0, 1100))
            axes.legend(loc="upper left")

    data = {"range_km": at_km, "area_plus_20_percent_m": more, "area_minus_20_percent_m": less}
    caption = "Error in detection range from a 20 % error in the visible area (eq. 33-34)."
    return Made(rows, [Picture("eq_34", caption, draw)], {"eq_34": data})
