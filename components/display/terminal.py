"""A run's summary as tables on the terminal."""

from collections.abc import Iterable
from typing import Any

from components.display.outcomes import NEAR_M, select_platform
from dsa_des.record.failure_counts import failure_sentences
from dsa_des.text.safe_text import escape_unprintable, shorten

MOST_TARGETS = 10
MOST_IN_A_LINE = 4


def print_run_summary(console: Any, summary: dict[str, Any]) -> None:
    """Print a run's summary: sensors, fusion, closest approaches, outcomes, attitude, speed.

    The first four platform by platform, where there are several.
    """
    for platform in summary.get("platforms") or ():
        _print_line(console, f"On board of {platform}")
        _print_platform_results(console, select_platform(summary, platform), platform)
        console.print()
    if not summary.get("platforms"):
        _print_platform_results(console, summary, "the ownship")
    for line in failure_sentences(summary.get("undone") or {}):
        _print_line(console, line)
    for line in derived_attitude_lines(summary.get("traffic") or {}):
        _print_line(console, line)
    speed = speed_text(summary.get("simulated_s"), summary.get("cpu_s"))
    if speed:
        _print_line(console, speed)
    if summary.get("out"):
        _print_line(console, f"Results in {summary['out']}")


def _print_platform_results(console: Any, summary: dict[str, Any], platform: str) -> None:
    """Print the results of one platform's blocks: sensors, fusion, closest approaches, outcomes."""
    if summary.get("sensors"):
        _print_table(
            console,
            "Sensors",
            ("sensor", "scans>", "detections>", "", "time [s]>", "true range>", "target"),
            _sensor_rows(summary["sensors"]),
        )
        for line in cut_off_detection_lines(
            summary["sensors"]
        ) + lines_on_sensors_without_detection(summary["sensors"]):
            _print_line(console, line)
        for key, said in (
            ("false_alarms", "False alarms (not counted above)"),
            ("unnamed_detections", "Detections of targets that the sensor does not name"),
        ):
            counts = [
                f"{name} {entry[key]:,}"
                for name, entry in summary["sensors"].items()
                if entry.get(key)
            ]
            if counts:
                _print_line(console, f"{said}: {', '.join(counts)}")
    if summary.get("fused"):
        _print_table(
            console,
            "Fused instants by combination of sensors (each target counts)",
            ("sensors", "fused>"),
            [(name, f"{count:,}") for name, count in _sort_by_number_of_sensors(summary["fused"])],
        )
    if summary.get("targets"):
        _print_closest_approaches(console, summary["targets"], platform)
    for line in outcome_lines(summary):
        _print_line(console, line)


def distance_text(range_m: float | None) -> str:
    """Return a distance as text, in m below 1 km, else in km; the word unknown for None."""
    if range_m is None:
        return "unknown"
    if round(range_m, 1) < 1000:
        return f"{range_m:.1f} m"
    return f"{range_m / 1000:,.2f} km"


def speed_text(simulated_s: float | None, cpu_s: float | None) -> str:
    """Return a sentence on simulated time per CPU time; empty where one of them is not known."""
    if simulated_s is None or cpu_s is None:
        return ""
    text = f"{simulated_s:.10g} s simulated in {cpu_s:.3g} s of CPU time"
    if cpu_s > 0:
        text += f": {float(f'{simulated_s / cpu_s:.3g}'):,.0f} simulated s per s"
    return text


def _sensor_rows(sensors: dict[str, Any]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, entry in sensors.items():
        start = (name, f"{entry['scans']:,}", f"{entry['detections']:,}")
        if entry["first_detection"] is None:
            rows.append((*start, "never", "", "", ""))
            continue
        for which in ("first", "last"):
            seen = entry[f"{which}_detection"]
            values = (f"{seen['time_s']:.3f}", distance_text(seen["range_m"]), seen["target"])
            rows.append((*start, which + ("*" if seen.get("at") else ""), *values))
            start = ("", "", "")
    return rows


#: Why a target was not looked at, by the name of the count.
_WHY_NOT_SEEN = {
    "absent": "absent",
    "off": "there while the sensor was off",
    "field_of_view": "outside its field of view",
    "range": "beyond its range",
    "hidden": "hidden by the Earth or its ground",
    "culled": "too far away to be looked at",
}


def cut_off_detection_lines(sensors: dict[str, Any]) -> list[str]:
    """Return one line on the asterisk of detections cut off at a run's start or end, or none."""
    ends = {
        f"{which} at {seen['at']}"
        for entry in sensors.values()
        for which in ("first", "last")
        if (seen := entry[f"{which}_detection"]) is not None and seen.get("at")
    }
    return [f"* cut off by the run: {', '.join(sorted(ends))}"] if ends else []


def lines_on_sensors_without_detection(sensors: dict[str, Any]) -> list[str]:
    """Return a line per sensor that detected nothing, with each reason and how often it applied."""
    lines = []
    for name, entry in sensors.items():
        if entry["first_detection"] is not None:
            continue
        evaluated = entry.get("evaluated", 0)
        skipped = {why: count for why, count in entry.get("skipped", {}).items() if count}
        every = evaluated + sum(skipped.values())
        if entry.get("enabled") is False:
            lines.append(f"{name} saw nothing: it is switched off (enabled = false)")
        elif not entry["scans"]:
            lines.append(f"{name} saw nothing: it never scanned")
        elif every:
            unit = "scans" if every == entry["scans"] else "looks (one per scan and target)"
            reasons = [
                f"{_WHY_NOT_SEEN.get(why, why)} in {count:,}"
                for why, count in sorted(skipped.items(), key=lambda item: -item[1])
            ]
            if evaluated:
                reasons.append(f"in reach but not detected in {evaluated:,}")
            lines.append(f"{name} saw nothing: target {', '.join(reasons)} of {every:,} {unit}")
    return lines


def outcome_lines(summary: dict[str, Any]) -> list[str]:
    """Return lines on the results of each tracker, alerter and manoeuvring block."""
    lines = [f"{name}: {_tracks_text(entry)}" for name, entry in summary.get("tracks", {}).items()]
    lines += [
        f"{name}: {entry['left_out']:,} of {entry['looks']:,} looks of {sensor} "
        f"({entry['share']:.0%}) came too late and were left out"
        for name, late in summary.get("late_looks", {}).items()
        for sensor, entry in late.items()
    ]
    for name, levels in summary.get("alerts", {}).items():
        of = summary.get("alerts_of", {}).get(name)
        name = f"{name} (by {' and '.join(of)})" if of else name
        lines += [
            f"{name}: level {level} {_span_text(entry)} ({_targets_text(entry['targets'])})"
            for level, entry in levels.items()
        ] or [f"{name}: no alert"]
    for name, entry in summary.get("manoeuvres", {}).items():
        text = "no manoeuvre"
        if entry["count"] == 1:
            text = f"1 manoeuvre, at {entry['first_s']:.1f} s"
        elif entry["count"]:
            text = f"{entry['count']:,} manoeuvres, from {entry['first_s']:.1f} s to "
            text += f"{entry['last_s']:.1f} s"
        lines.append(f"{name}: {text}")
    return lines


def _tracks_text(entry: dict[str, Any]) -> str:
    count = entry["confirmed"]
    if not count:
        return "no confirmed track"
    text = f"{count:,} confirmed track{'s' if count > 1 else ''}"
    false = entry.get("false")
    if false is not None:
        text += f", {false:,} of them false" if false else ", none false"
    elif "false" in entry:
        text += " without a range" if count == 1 else ", all without a range"
    if entry.get("position_error_m") is not None:
        text += f"; position error {distance_text(entry['position_error_m'])} rms"
    if not entry.get("targets"):
        return f"{text}; first confirmed {_time_and_range_text(entry['first_confirmed'])}"
    firsts = [
        f"{name} {_time_and_range_text(first)}"
        for name, first in _earliest_targets(entry["targets"])
    ]
    text += f"; first within {NEAR_M:g} m of {', '.join(firsts)}"
    return text + _further_targets_text(entry["targets"])


def _time_and_range_text(first: dict[str, Any]) -> str:
    away = "" if first["range_m"] is None else f" ({distance_text(first['range_m'])} away)"
    return f"at {first['time_s']:.1f} s{away}"


def _span_text(entry: dict[str, Any]) -> str:
    if entry["first_s"] == entry["last_s"]:
        return f"at {entry['first_s']:.1f} s"
    return f"from {entry['first_s']:.1f} s to {entry['last_s']:.1f} s"


def _targets_text(targets: dict[str, dict[str, float]]) -> str:
    if len(targets) == 1:
        return next(iter(targets))
    spans = [f"{name} {_span_text(entry)}" for name, entry in _earliest_targets(targets)]
    return ", ".join(spans) + _further_targets_text(targets)


def _earliest_targets(targets: dict[str, Any]) -> list[tuple[str, Any]]:
    """Return the few targets with the earliest time, in order of time."""
    return sorted(targets.items(), key=lambda item: next(iter(item[1].values())))[:MOST_IN_A_LINE]


def _further_targets_text(targets: dict[str, Any]) -> str:
    more = len(targets) - MOST_IN_A_LINE
    return f" and {more:,} more target{'s' if more > 1 else ''}" if more > 0 else ""


def derived_attitude_lines(traffic: dict[str, Any]) -> list[str]:
    """Return a line on attitudes derived from flight paths, with their error; else empty."""
    derived = traffic.get("derived_attitude")
    if not derived:
        return []
    error_deg = derived.get("median_azimuth_error_deg")
    angles = [angle for angle in ("yaw", "pitch", "roll") if angle in derived]
    names = list(dict.fromkeys(name for angle in angles for name in derived[angle]))
    shown = ", ".join(names[:MOST_TARGETS]) + (", …" if len(names) > MOST_TARGETS else "")
    line = f"Attitude derived from the flight path, not measured ({', '.join(angles)}): {shown}"
    if error_deg is not None:
        line += (
            f". Expected error in azimuth {error_deg:g}° (median against the measured attitude of "
            "flown intercepts), and fields of view follow from it"
        )
    return [line]


def _sort_by_number_of_sensors(fused: dict[str, int]) -> list[tuple[str, int]]:
    """Return the sensor combinations with their counts, those of the fewest sensors first."""
    return sorted(fused.items(), key=lambda item: (item[0].count("+"), item[0]))


def _print_closest_approaches(console: Any, targets: dict[str, Any], platform: str) -> None:
    met = [
        (entry["closest_approach"], name)
        for name, entry in targets.items()
        if entry.get("closest_approach") is not None
    ]
    met.sort(key=lambda item: item[0]["range_m"])
    rows = [
        (
            name,
            f"{approach['time_s']:.3f}",
            distance_text(approach["range_m"]),
            f"at {approach['at']}" if approach.get("at") else "",
        )
        for approach, name in met[:MOST_TARGETS]
    ]
    notes = []
    if len(met) > MOST_TARGETS:
        notes.append(f"{len(met) - MOST_TARGETS:,} more pass farther away")
    if len(met) < len(targets):
        notes.append(f"{len(targets) - len(met):,} are never there together with {platform}")
    title = "Closest approach to each target"
    if notes:
        title += f" ({'; '.join(notes)})"
    _print_table(console, title, ("target", "time [s]>", "true range>", ""), rows)


def _print_table(
    console: Any, title: str, columns: Iterable[str], rows: Iterable[tuple[str, ...]]
) -> None:
    """Print a table; columns whose name ends in ``>`` hold numbers, flush right."""
    from rich import box
    from rich.table import Table
    from rich.text import Text  # names are printed as they are, never read as markup

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1))
    for name in columns:
        number = name.endswith(">")
        table.add_column(
            Text(name.removesuffix(">")),
            justify="right" if number else "left",
            no_wrap=number or not name,
            overflow="fold",
        )
    for row in rows:
        table.add_row(*(Text(shorten(text)) for text in row))
    console.print(Text(title, style="bold"))
    console.print(table)
    console.print()


def _print_line(console: Any, text: str) -> None:
    # Never wrapped: a path is there to be copied.
    console.print(escape_unprintable(text), markup=False, highlight=False, soft_wrap=True)
