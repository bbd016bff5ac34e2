"""Fig. 4.14: errors of the fused output of an overtaking intruder, over what may have flown.

The thesis prints the range at which the EO camera joins, 5.1 km, but neither the aircraft nor how
far to the left and how high it passes.
"""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from components.thesis.drawing import FUSION, GREY, RADAR, draw_legend_below, panels_written_as_png
from components.thesis.rows import Cells, Made, Picture, Printed, Row, calibrated
from components.thesis.scenes import load_config_scene, run, silhouette_area_keywords
from dsa_des.block.mark import BLUE, GREEN, ORANGE

#: Aircraft of Table 3.1, by file.
AIRCRAFT = {"king_air": "King Air", "f_16": "F-16", "boeing_787": "Boeing 787"}
LEFT_M = (500, 1500, 3000)
ABOVE_M = (200, 400, 800)
#: Long enough for a Boeing 787 to leave the camera's reach.
_DURATION_S = 260


def fly_overtaking() -> dict[str, Any]:
    """Run fig_4_14 for all aircraft, lateral and vertical offsets; return the result columns.

    By column: the range within which the EO camera joins, and the flight.
    """
    flights = [(file, left, above) for file, above, left in product(AIRCRAFT, ABOVE_M, LEFT_M)]
    file, left_m, above_m = map(np.array, zip(*flights, strict=True))
    joins_km = np.array([_first_eo_fusion_range_km(*flight) for flight in flights])
    return {"aircraft": file, "left_m": left_m, "above_m": above_m, "joins_km": joins_km}


def eo_joining_range_spread(flights: dict[str, Any], printed: Printed) -> tuple[list[Row], Picture]:
    """Return rows and figure of least and greatest range of the EO camera joining, by aircraft."""
    where = (
        f"Passing {LEFT_M[0]} to {LEFT_M[-1]} m to the left, {ABOVE_M[0]} to {ABOVE_M[-1]} m above."
    )
    rows = []
    for file, name in AIRCRAFT.items():
        ranges = np.sort(flights["joins_km"][flights["aircraft"] == file]).tolist()
        inside = ranges[0] <= printed.value <= ranges[-1]
        side = "within" if inside else "outside"
        says = f"{where} The printed {printed.text} km is {side} this spread."
        rows += [
            Row(f"EO joins, {name}, nearest of {len(ranges)} flights", ranges[0], "km", says),
            Row(f"EO joins, {name}, farthest of {len(ranges)} flights", ranges[-1], "km", says),
        ]

    def draw(path: Path) -> None:
        with panels_written_as_png(path) as (axes,):
            for (file, name), colour in zip(AIRCRAFT.items(), (BLUE, ORANGE, GREEN), strict=True):
                for above, style in zip(ABOVE_M, ("o:", "s--", "^-"), strict=True):
                    shown = (flights["aircraft"] == file) & (flights["above_m"] == above)
                    axes.plot(flights["left_m"][shown], flights["joins_km"][shown], style,
                              color=colour, markersize=4, linewidth=1.0,
                              label=f"{name}, {above} m above")  # fmt: skip
            axes.axhline(printed.value, color=GREY, linewidth=1.2,
                         label=f"thesis: {printed.text} km")  # fmt: skip
            axes.set_xlabel("distance to the left at which the intruder passes (m)")
            axes.set_ylabel("range within which the EO joins (km)")
            axes.set(xlim=(0, 3500), ylim=(0, 14))
            draw_legend_below(axes, 3)

    caption = (
        "The range within which the EO camera joins, by aircraft and by the flight, none of which "
        "the thesis prints: what it prints is one line across all of them."
    )
    return rows, Picture("fig_4_14_flights", caption, draw)


def _first_eo_fusion_range_km(file: str, left_m: int, above_m: int) -> float:
    intruder = "blocks.traffic.intruders.overtaking"
    done = run(
        load_config_scene(
            "thesis/fig_4_14",
            f"duration_s={_DURATION_S}",
            f"{intruder}.east_m={-left_m}",
            f"{intruder}.up_m={above_m}",
            *(
                f"{intruder}.eo.{name}={area}"
                for name, area in silhouette_area_keywords(file).items()
            ),
        )
    )
    seen = done.matching_rows("fused", block="fusion")
    return float(seen["true_range_m"][seen["angle_source"] == "eo"].max()) / 1000.0


def overtaking(printed: Cells) -> Made:
    """Fig. 4.14: rows and figure of fused range, azimuth and elevation errors during an overtaking,
    and of variants of the flight.
    """
    done = run(load_config_scene("thesis/fig_4_14"))
    seen = done.matching_rows("fused", block="fusion")
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
    flights = fly_overtaking()
    others, figure = eo_joining_range_spread(flights, printed["joins_km"])
    rows = [
        printed["joins_km"].compare(
            "range within which the EO camera joins, in the flight drawn", joins_km, "km",
            "A King Air 1300 m to the left and 400 m above, chosen in round numbers so that it "
            "comes near; 0.15 km, two scans, are allowed for.",
            calibrated("aircraft and flight, neither of which is printed",
                       "thesis/fig_4_14.toml:blocks.traffic.intruders.overtaking.east_m",
                       "thesis/fig_4_14.toml:blocks.traffic.intruders.overtaking.up_m")),
        *others,
        Row("share of fused detections with a range", float(np.isfinite(errors_m).mean()), "",
            "The thesis says in words that the radar determines the range constantly.",
            derived="1, in words"),
        *(
            Row(f"largest {angle} error, {who}", float(np.abs(values[part]).max()), "deg", grid)
            for angle, values in (("azimuth", azimuth), ("elevation", elevation))
            for who, part in (("radar alone", alone), ("with EO", with_eo))
        ),
        Row("root mean square azimuth error, radar alone over with EO",
            float(np.sqrt(np.mean(azimuth[alone] ** 2) / np.mean(azimuth[with_eo] ** 2))), "",
            f"About the ratio of the grids, {radar['azimuth_resolution_deg']:g}° to "
            f"{pixel_deg:.4f}°."),
        Row("largest range error", float(np.abs(errors_m).max()), "m", why),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        shown = (("range error (m)", errors_m), ("azimuth error\n(deg)", azimuth),
                 ("elevation error\n(deg)", elevation))  # fmt: skip
        with panels_written_as_png(path, 3, 1, sharex=True, height_in=5.4) as axes:
            for one, (label, values) in zip(axes, shown, strict=True):
                for part, marker, colour, said in (
                    (alone, "o", RADAR, "radar alone"),
                    (with_eo, "s", FUSION, "radar and EO"),
                ):
                    one.plot(time_s[part], values[part], marker, markersize=3, color=colour,
                             label=said)  # fmt: skip
                one.axvline(time_s[with_eo].max(), color=GREY, linestyle=":", linewidth=1.0)
                one.set_ylabel(label)
                one.margins(y=0.12)
            axes[0].set_title(
                f"EO sees the intruder up to {joins_km:.2f} km (dotted); it then flies ahead",
                loc="left",
            )
            draw_legend_below(axes[0])
            axes[-1].set_xlabel("time (s)")
            far = axes[-1].secondary_xaxis(
                -0.42,
                functions=(
                    lambda t: np.interp(t, time_s, range_km),
                    lambda r: np.interp(r, range_km, time_s),
                ),
            )
            far.set_xlabel("range (km)")  # fmt: skip

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
        [Picture("fig_4_14", caption, draw), figure],
        {"fig_4_14": data, "fig_4_14_flights": flights},
    )
