"""Fig. 4.14: the fused output's errors while an intruder overtakes to the left and above."""

from pathlib import Path

import numpy as np

from components.thesis import overtaking_flights
from components.thesis.basis import calibrated
from components.thesis.made import Made, Picture
from components.thesis.plotting import FUSION, GREY, RADAR, legend_below, panels
from components.thesis.printed import printed
from components.thesis.row import Row
from components.thesis.scene_run import run, scene


def make() -> Made:
    """Return the errors of range, azimuth and elevation over time."""
    done = run(scene("thesis/fig_4_14"))
    seen = done.rows("fused", block="fusion")
    time_s, range_km = seen["time_s"], seen["true_range_m"] / 1000.0
    with_eo = seen["angle_source"] == "eo"
    azimuth = np.degrees(seen["azimuth_rad"] - seen["true_azimuth_rad"])
    elevation = np.degrees(seen["elevation_rad"] - seen["true_elevation_rad"])
    errors_m = seen["range_m"] - seen["true_range_m"]
    joins_km = float(range_km[with_eo].max())
    radar = done.simulation.scene.blocks["radar"].parameters.model_dump()
    pixel_deg = np.degrees(done.simulation.components["eo"].pixel_azimuth_rad)  # type: ignore[attr-defined]
    alone = ~with_eo
    why = "The scene fig_4_14; sensors as in sensors/oasys.toml and sensors/afrl_eo.toml."
    grid = "Rounding to the grid errs by half a step at most."
    others, flights, flights_data = overtaking_flights.spread(overtaking_flights.flown())
    rows = [
        Row("range within which the EO camera joins, in the flight drawn", joins_km, "km",
            "A King Air 1300 m to the left and 400 m above, chosen in round numbers so that it "
            "comes near; 0.15 km, two scans, are allowed for.", printed("fig-4.14", "joins_km"),
            0.15, basis=calibrated(
                "aircraft and flight, neither of which is printed",
                "thesis/fig_4_14.toml:blocks.traffic.intruders.overtaking.east_m",
                "thesis/fig_4_14.toml:blocks.traffic.intruders.overtaking.up_m")),
        *others,
        Row("share of fused detections with a range", float(np.isfinite(errors_m).mean()), "",
            "The thesis says in words that the radar determines the range constantly.",
            derived="1, in words"),
        Row("largest azimuth error, radar alone", float(np.abs(azimuth[alone]).max()), "deg", grid),
        Row("largest azimuth error, with EO", float(np.abs(azimuth[with_eo]).max()), "deg", grid),
        Row("largest elevation error, radar alone", float(np.abs(elevation[alone]).max()), "deg",
            grid),
        Row("largest elevation error, with EO", float(np.abs(elevation[with_eo]).max()), "deg",
            grid),
        Row("root mean square azimuth error, radar alone over with EO",
            float(np.sqrt(np.mean(azimuth[alone] ** 2) / np.mean(azimuth[with_eo] ** 2))), "",
            f"About the ratio of the grids, {radar['azimuth_resolution_deg']:g}° to "
            f"{pixel_deg:.4f}°."),
        Row("largest range error", float(np.abs(errors_m).max()), "m", why),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        shown = (("range error [m]", errors_m), ("azimuth error\n[deg]", azimuth),
                 ("elevation error\n[deg]", elevation))  # fmt: skip
        with panels(path, 3, 1, sharex=True, height_in=5.4) as axes:
            for one, (label, values) in zip(axes, shown, strict=True):
                one.plot(
                    time_s[alone],
                    values[alone],
                    "o",
                    markersize=3,
                    color=RADAR,
                    label="radar alone",
                )
                one.plot(time_s[with_eo], values[with_eo], "s", markersize=3, color=FUSION,
                         label="radar and EO")  # fmt: skip
                one.axvline(time_s[with_eo].max(), color=GREY, linestyle=":", linewidth=1.0)
                one.set_ylabel(label)
                one.margins(y=0.12)
            axes[0].set_title(
                f"EO sees the intruder up to {joins_km:.2f} km (dotted); it then flies ahead",
                loc="left",
            )
            legend_below(axes[0])
            axes[-1].set_xlabel("time [s]")
            far = axes[-1].secondary_xaxis(
                -0.42,
                functions=(
                    lambda t: np.interp(t, time_s, range_km),
                    lambda r: np.interp(r, range_km, time_s),
                ),
            )
            far.set_xlabel("range [km]")  # fmt: skip

    data = {
        "time_s": time_s,
        "range_km": range_km,
        "range_error_m": errors_m,
        "azimuth_error_deg": azimuth,
        "elevation_error_deg": elevation,
        "sensors": seen["sensors"],
    }
    caption = (
        "Errors in the sensor fusion block output illustrating the fusion of sensor detections "
        "with different resolutions: the intruder overtakes to the left and above."
    )
    return Made(
        rows,
        [Picture("fig_4_14", caption, draw), flights],
        {"fig_4_14": data, "fig_4_14_flights": flights_data},
    )
