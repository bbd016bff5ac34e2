"""Runs seen from above, Figs 4.17 to 4.22: fields of view, Pd, resolution, scan rates, fusion."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from components.display.symbols import sensor_marks
from components.thesis.drawing import (
    EO,
    FUSION,
    GREY,
    IR,
    RADAR,
    draw_legend_below,
    draw_map,
    line_from_ownship,
    mark_true_target_positions,
    panels_written_as_png,
    reported_positions_km,
    true_target_positions_km,
)
from components.thesis.radar import CLASSES, swerling1_pd_at_ranges
from components.thesis.rows import Cells, Columns, Made, Row, configured, predicted
from components.thesis.scenes import load_config_scene, radar_parameters, run
from dsa_des.arrays.types import AnyArray
from dsa_des.block.mark import BLUE, ORANGE


def _concatenate_tables(
    seen: Mapping[Any, Mapping[str, AnyArray]], keys: Iterable[str], name: str = ""
) -> dict[str, AnyArray]:
    """Return several tables' given columns end to end, with a column `name` of each row's table."""
    labels = {name: np.repeat(list(seen), [len(rows["time_s"]) for rows in seen.values()])}
    joined = {key: np.concatenate([rows[key] for rows in seen.values()]) for key in keys}
    return {**(labels if name else {}), **joined}


#: Sensor → where the half width of its field of view is printed.
EDGES = {
    "radar": "Table 2.2",
    "eo": "Table 2.5, 220° across",
    "ir": "Table 2.6, 100° across",
}
STEP_DEG = 100.0 / 4000.0 * 180.0 / np.pi


def fields_of_view(printed: Cells) -> Made:
    """Fig. 4.17: the azimuths between which each sensor detects a circling intruder."""
    done = run(load_config_scene("thesis/fig_4_17"))
    seen = {name: done.matching_rows("detections", block=name) for name in EDGES}
    rows = []
    for name, source in EDGES.items():
        edge = configured(f"the field of view of {name}, {source}",
                          f"thesis/fig_4_17.toml:blocks.{name}.azimuth_deg")  # fmt: skip
        azimuth = np.degrees(seen[name]["true_azimuth_rad"])
        for side, ours in (("right", azimuth.max()), ("left", -azimuth.min())):
            rows.append(printed[name].compare(
                f"outermost detection to the {side}, {name}", float(ours), "deg",
                f"The intruder moves {STEP_DEG:.2f}° per scan.", edge,
                tolerance=STEP_DEG))  # fmt: skip
    rows += [
        Row(f"detections of the {name} in one circle", len(seen[name]["time_s"]), "",
            "One scan per second, the circle takes 251 s.")
        for name in EDGES
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, 1, 3, sharey=True, width_in=9.0, height_in=3.6) as axes:
            for one, name in zip(axes, EDGES, strict=True):
                draw_map(one, done, fields_of_view=(name,))
                style = sensor_marks([name], done.simulation.components)[name]
                mark_true_target_positions(
                    one, done, seen[name], markersize=3.5, color=style.colour
                )
                one.set_title(f"{name}: ±{printed[name].text}°", loc="left")
                one.set(xlim=(-6.4, 6.4), ylim=(-4.4, 6.4))
            grey = {"color": GREY, "linestyle": "none", "fillstyle": "none", "markersize": 3.5}
            axes[0].plot([], [], "o", **grey, label="detected (in the sensor's colour)")
            draw_legend_below(axes[0], without="field of view")
            for one in axes[1:]:
                one.set_ylabel("")

    data = _concatenate_tables(seen, ("block", "time_s", "true_azimuth_rad", "true_range_m"))
    caption = (
        "All three sensors' fields of view: the ownship (star) is stationary, the intruder circles "
        "it, and circles mark where each sensor detects it. The range of a field of view is only "
        "the farthest that is looked at."
    )
    return Made.with_figure(rows, "fig_4_17", caption, draw, data)


EDGES_KM = np.arange(1.0, 16.0)


def detections_over_range(_: Cells) -> Made:
    """Fig. 4.18: the share of scans that detect, by range, beside the radar's Pd."""
    done = run(load_config_scene("thesis/fig_4_18"))
    sensor = radar_parameters()
    budget, small_dbsm = sensor.link_budget(), CLASSES["small"][0]
    seen = done.matching_rows("detections", block="radar")
    scans_s = done.matching_rows("scans", block="radar")["time_s"]
    range_km = np.concatenate([
        np.interp(scans_s, track.time_s, track.range_m) / 1000.0 for track in done.flights.targets
    ])  # fmt: skip
    pd_of_scan = np.asarray(swerling1_pd_at_ranges(sensor, budget, small_dbsm, range_km))
    looked = np.histogram(range_km, EDGES_KM)[0]
    result = np.histogram(seen["true_range_m"] / 1000.0, EDGES_KM)[0]
    middle_km = 0.5 * (EDGES_KM[1:] + EDGES_KM[:-1])
    share = result / looked
    # Pd falls within a bin: what is expected is its mean over the scans that fell there.
    pd = np.histogram(range_km, EDGES_KM, weights=pd_of_scan)[0] / looked
    variance = np.histogram(range_km, EDGES_KM, weights=pd_of_scan * (1.0 - pd_of_scan))[0]
    sigma = np.sqrt(variance) / looked
    source = "The scene fig_4_18, nine small targets; sensors/oasys.toml."
    rows = [
        Row(f"share of scans that detect, {low:g} to {low + 1:g} km", float(share[index]), "",
            f"{source} The mean Pd of these scans is {pd[index]:.3f}.")
        for index, low in enumerate(EDGES_KM[:-1])
        if low in (2.0, 6.0, 10.0, 14.0)
    ]  # fmt: skip
    chi_square = float(np.sum(((share - pd) / sigma) ** 2))
    expected = "Fourteen bins of 1 km; 1 is expected, 2.1 exceeded by chance in 1 %."
    rows.append(
        Row("chi-square of the shares about Pd, per bin", chi_square / len(share), "", expected)
    )

    def draw(path: Path) -> None:
        with panels_written_as_png(path, 1, 2, width_in=9.0, height_in=4.0) as (plan, shares):
            draw_map(plan, done, fields_of_view=("radar",))
            few = {name: column[seen["scan"] % 5 == 0] for name, column in seen.items()}
            mark_true_target_positions(
                plan, done, few, markersize=3.5, label="detected (one scan in five)"
            )
            plan.set(xlim=(-16, 16), ylim=(-6, 16))
            draw_legend_below(plan)
            curve_km = np.linspace(1.0, 15.0, 141)
            curve = swerling1_pd_at_ranges(sensor, budget, small_dbsm, curve_km)
            shares.plot(curve_km, curve, color=BLUE, label="Pd, Swerling I, 1.76 dBsm")
            shares.errorbar(middle_km, share, 2.0 * sigma, fmt="o", markersize=4, color=ORANGE,
                            label="share of scans that detect (±2σ)")  # fmt: skip
            shares.set_xlabel("range (km)")
            shares.set_ylabel("probability of detection [1]")
            shares.set(xlim=(0, 15.5), ylim=(0, 1.08))
            shares.legend(loc="lower left")

    data = {"range_km": middle_km, "share_detected": share, "pd": pd, "scans": looked}
    caption = "Scenario showing the radar probability of detection decreasing with range."
    return Made.with_figure(rows, "fig_4_18", caption, draw, data)


#: The panel's title in the thesis, and Table 2.2's own.
RESOLUTIONS_DEG = (1.0, 2.5)


def angular_resolution(printed: Cells) -> Made:
    """Fig. 4.19: spacing and errors of the reported azimuths on a fine and on a coarse grid."""
    runs = {
        step: run(
            load_config_scene("thesis/fig_4_19", f"blocks.radar.azimuth_resolution_deg={step}")
        )
        for step in RESOLUTIONS_DEG
    }
    seen = {step: one.matching_rows("detections", block="radar") for step, one in runs.items()}
    grid = configured("the azimuth grid of scene fig_4_19", "maps:RESOLUTIONS_DEG")
    rows = []
    for step, cell in zip(RESOLUTIONS_DEG, ("fine_deg", "coarse_deg"), strict=True):
        reported = np.unique(np.round(np.degrees(seen[step]["azimuth_rad"]), 9))
        error = np.degrees(seen[step]["azimuth_rad"] - seen[step]["true_azimuth_rad"])
        rows += [
            printed[cell].compare(
                f"spacing of the reported azimuths at {step:g}°", float(np.diff(reported).min()),
                "deg", "Rounded to the sensor's grid (§3.5.1).", grid),
            Row(f"largest azimuth error at {step:g}°", float(np.abs(error).max()), "deg",
                "At most half a step of the grid."),
        ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, 1, 2, sharey=True, width_in=9.0, height_in=3.9) as axes:
            for one, step in zip(axes, RESOLUTIONS_DEG, strict=True):
                draw_map(one, runs[step])
                for azimuth in np.unique(np.round(np.degrees(seen[step]["azimuth_rad"]), 6)):
                    one.plot(
                        *line_from_ownship(azimuth, 6.0), color="#BBBBBB", linewidth=0.5, zorder=0.5
                    )
                east, north = reported_positions_km(seen[step])
                one.plot(east, north, "o", color=RADAR, fillstyle="none", markersize=4.5,
                         label="reported by radar")  # fmt: skip
                one.set_title(f"Radar detection: azimuth resolution {step:g}°", loc="left")
                one.set(xlim=(-4.2, 4.2), ylim=(-0.4, 5.0))
            axes[1].set_ylabel("")
            draw_legend_below(axes[0])

    keys = ("time_s", "azimuth_rad", "true_azimuth_rad", "range_m", "true_range_m")
    data = _concatenate_tables(seen, keys, "resolution_deg")
    caption = (
        "What happens when the angular resolution of a sensor is changed: reported positions lie "
        "on rays of the grid (grey)."
    )
    return Made.with_figure(rows, "fig_4_19", caption, draw, data)


COMBINATIONS = {"radar": ("s", RADAR), "radar+eo": ("D", FUSION), "eo": ("o", EO)}


def two_fields_of_view(_: Cells) -> Made:
    """Fig. 4.20: rows counting an intruder's scans by radar and EO detection, and the map."""
    done = run(load_config_scene("thesis/fig_4_20"))
    fused = {
        name: done.matching_rows("fused", block="fusion", sensors=name) for name in COMBINATIONS
    }
    scans = len(done.matching_rows("scans", block="radar")["time_s"])
    counts = {name: len(rows["time_s"]) for name, rows in fused.items()}
    counts["no detection"] = scans - sum(counts.values())
    both = np.degrees(fused["radar+eo"]["true_azimuth_rad"])
    why = "The scene fig_4_20; both sensors scan once per second."
    rows = [
        Row("combinations of detection that occur", sum(count > 0 for count in counts.values()), "",
            f"{why} The thesis lists four, and the scene is laid out so that they occur.",
            derived="4, listed"),
        *(Row(f"scans with: {name}", count, "", why) for name, count in counts.items()),
        Row("azimuth from which both detect", float(both.min()), "deg",
            "The EO camera's field of view begins at -15°."),
        Row("azimuth up to which both detect", float(both.max()), "deg",
            "The radar's field of view ends at 15°."),
        Row("share of EO-only detections without a range",
            float(np.isnan(fused["eo"]["range_m"]).mean()), "", "A camera measures none."),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, height_in=4.3) as (axes,):
            draw_map(axes, done, fields_of_view=("radar", "eo"))
            for name, (marker, colour) in COMBINATIONS.items():
                label = f"detected by {name.replace('+', ' and ')}"
                mark_true_target_positions(
                    axes, done, fused[name], marker=marker, color=colour, label=label
                )
            axes.set(xlim=(-5.4, 5.4), ylim=(-0.4, 6.2))
            draw_legend_below(axes, 3)

    east, north = zip(
        *(true_target_positions_km(done, rows) for rows in fused.values()), strict=True
    )
    data = {
        **_concatenate_tables(fused, ("time_s",), "sensors"),
        "east_km": np.concatenate(east),
        "north_km": np.concatenate(north),
    }
    caption = (
        "The workings of the fusion by one intruder traversing two fields of view from left to "
        "right: no detection, radar, radar and EO, EO alone, no detection."
    )
    return Made.with_figure(rows, "fig_4_20", caption, draw, data)


#: Scan rates of the two panels, Hz.
RATES_HZ = ("0.5", "0.1")
STEPS, INTRUDERS, SENSORS = 1800, 4, 3


def scan_rate(printed: Cells) -> Made:
    """Fig. 4.21: detections at two scan rates, and the time of the whole scene at 10 Hz."""
    loaded = load_config_scene("thesis/fig_4_21")
    run(loaded)  # the first run also loads what Python has not loaded yet
    timed = min((run(loaded) for _ in range(3)), key=lambda one: one.wall_s)
    scans = len(timed.matching_rows("scans", block="radar")["time_s"])
    runs = {rate: run(load_config_scene("thesis/fig_4_21", f"blocks.radar.scan_rate_hz={rate}"))
            for rate in RATES_HZ}  # fmt: skip
    seen = {rate: one.matching_rows("detections", block="radar") for rate, one in runs.items()}
    why = "The fastest of three runs in memory, every sensor at every step; read from the clock."
    clock = predicted("a run on this machine", "thesis/fig_4_21.toml:blocks")
    against = "time of the whole simulation, against"
    rows = [
        printed["steps"].compare(
            "steps of the timed scene", scans, "", "",
            configured("180 s at 10 Hz", "thesis/fig_4_21.toml:duration_s",
                       "thesis/fig_4_21.toml:blocks.radar.scan_rate_hz")),
        printed["intruders"].compare(
            "intruders of the timed scene", len(timed.flights.targets), "", "",
            configured("the scene's traffic", "thesis/fig_4_21.toml:blocks.traffic.intruders")),
        printed["wall_s"].compare(f"{against} §4.5", timed.wall_s, "s", why, clock),
        printed["wall_later_s"].compare(f"{against} §5.1.3", timed.wall_s, "s", why, clock,
                                       again=f"{against} §4.5"),
        Row("target-scans per second", STEPS * INTRUDERS * SENSORS / timed.wall_s, "1/s",
            "4 × 1800 × 3 sensors over our time; 7200: over the thesis's 3 s (errata 24).",
            derived="7200"),
        *(Row(f"detections of the radar at {rate} Hz", len(rows["time_s"]), "",
              "The scene fig_4_21 with that scan rate.") for rate, rows in seen.items()),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, 1, 2, sharey=True, width_in=9.0, height_in=4.0) as axes:
            for one, rate in zip(axes, RATES_HZ, strict=True):
                draw_map(one, runs[rate])
                mark_true_target_positions(
                    one, runs[rate], seen[rate], markersize=3.5, label="detected by radar"
                )
                one.set_title(f"Radar detection: scan rate {rate} Hz", loc="left")
            axes[1].set_ylabel("")
            draw_legend_below(axes[0])

    data = _concatenate_tables(
        seen, ("target", "time_s", "true_azimuth_rad", "true_range_m"), "scan_rate_hz"
    )
    caption = (
        "Influence of the scan rate: four intruders, radar at two scan rates. The thesis timed "
        "this scenario over 1800 time steps."
    )
    return Made.with_figure(rows, "fig_4_21", caption, draw, data)


_MARKS = {"radar": ("s", RADAR, 3.0), "ir": ("^", IR, 5.0), "radar+ir": ("D", FUSION, 5.0)}


def unsynchronised(printed: Cells) -> Made:
    """Fig. 4.22: radar at 5 Hz, IR at 2 Hz, and which of their detections are fused."""
    done = run(load_config_scene("thesis/fig_4_22"))
    fused = {name: done.matching_rows("fused", block="fusion", sensors=name) for name in _MARKS}
    alone, together = len(fused["ir"]["time_s"]), len(fused["radar+ir"]["time_s"])
    gated = run(load_config_scene("thesis/fig_4_22", "blocks.fusion.coincidence_s=0.1"))
    with_gate = len(gated.matching_rows("fused", block="fusion", sensors="radar+ir")["time_s"])
    rows = [
        printed["share"].compare(
            "share of IR detections fused with the radar's", together / (alone + together), "",
            "Scans k/2 s and k/5 s meet every second: at every second IR scan (errata 25).",
            predicted("the printed scan rates, 5 and 2 Hz, both from time 0 (assumption)",
                      "thesis/fig_4_22.toml:blocks.radar.scan_rate_hz",
                      "thesis/fig_4_22.toml:blocks.ir.scan_rate_hz")),
        Row("IR detections", alone + together, "", "30 s at 2 Hz, none missed."),
        Row("radar detections", len(fused["radar"]["time_s"]) + together, "",
            "30 s at 5 Hz, none missed."),
        Row("fused detections with a coincidence gate of 0.1 s", with_gate, "",
            "A gate is one way out; the thesis leaves it to the tracker."),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, 1, 2, width_in=9.0, height_in=3.8) as (plan, times):
            draw_map(plan, done)
            for height, (name, (marker, colour, size)) in enumerate(_MARKS.items()):
                label = f"{name.replace('+', ' and ')}{' fused' if '+' in name else ' alone'}"
                style = {"marker": marker, "color": colour, "markersize": size}
                first = {key: column[fused[name]["time_s"] < 10.0]
                         for key, column in fused[name].items()}  # fmt: skip
                mark_true_target_positions(plan, done, first, **style, label=label)
                times.plot(first["time_s"], np.full(len(first["time_s"]), height), **style,
                           fillstyle="none", linestyle="none")  # fmt: skip
            plan.set(xlim=(-1.55, -0.45), ylim=(2.2, 2.8))
            plan.set_title("Radar/IR detection, first 10 s", loc="left")
            times.set_yticks(range(len(_MARKS)), ["radar alone", "IR alone", "fused"])
            times.set_xticks(range(11))
            times.set(xlim=(-0.3, 10.3), ylim=(-0.5, len(_MARKS) - 0.5))
            times.set_title("radar scan rate 5 Hz, IR scan rate 2 Hz", loc="left")
            times.set_xlabel("time (s)")
            draw_legend_below(plan, 5, without="ownship")

    data: Columns = _concatenate_tables(fused, ("time_s",), "sensors")
    caption = "Scenario with two sensors with different scan rates, which are not synchronised."
    return Made.with_figure(rows, "fig_4_22", caption, draw, data)
