"""A run's summary as tables on the terminal."""

from typing import Any

MOST_TARGETS = 10


def show(console: Any, summary: dict[str, Any]) -> None:
    """Print a run's summary: sensors, fused combinations, closest approaches, speed.

    Parameters
    ----------
    console : rich.console.Console
    summary : dict
        As described in `DetectAndSenseReport.show`.
    """
    if summary.get("sensors"):
        console.print(_sensors(summary["sensors"]))
    if summary.get("fused"):
        console.print(_fused(summary["fused"]))
    if summary.get("targets"):
        for item in _targets(summary["targets"]):
            console.print(item)
    speed = speed_text(summary.get("simulated_s"), summary.get("cpu_s"))
    if speed:
        console.print(speed, markup=False, highlight=False)
    if summary.get("out"):
        # Never cut or wrapped: it is there to be copied.
        console.print(f"Results in {summary['out']}", markup=False, highlight=False,
                      soft_wrap=True)  # fmt: skip


def distance_text(range_m: float | None) -> str:
    """Return a distance for reading: metres below 1 km, otherwise km."""
    if range_m is None:
        return "-"
    if round(range_m, 1) < 1000:
        return f"{range_m:.1f} m"
    return f"{range_m / 1000:,.2f} km"


def time_text(time_s: float) -> str:
    """Return an instant in s, to the millisecond where it needs that."""
    text = f"{time_s:.3f}"
    return text.removesuffix("00") if text.endswith("00") else text


def speed_text(simulated_s: float | None, cpu_s: float | None) -> str:
    """Return how fast the run was, as a sentence."""
    if simulated_s is None or cpu_s is None:
        return ""
    text = f"{simulated_s:,g} s simulated in {cpu_s:.3g} s of CPU"
    if cpu_s > 0:
        text += f": {float(f'{simulated_s / cpu_s:.3g}'):,.0f} simulated seconds per second"
    return text


def _table(title: str) -> Any:
    from rich import box
    from rich.table import Table

    return Table(
        title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, padding=(0, 1),
        pad_edge=False,
    )  # fmt: skip


def _cell(text: str) -> Any:
    from rich.text import Text  # names are printed as they are, not as markup

    return Text(text, overflow="fold")


def _sensors(sensors: dict[str, Any]) -> Any:
    table = _table("Sensors")
    table.add_column("sensor")
    table.add_column("scans", justify="right", no_wrap=True)
    table.add_column("detections", justify="right", no_wrap=True)
    table.add_column("")
    table.add_column(_cell("time [s]"), justify="right", no_wrap=True)
    table.add_column("true range", justify="right", no_wrap=True)
    table.add_column("target")
    for name, entry in sensors.items():
        counts = [name, f"{entry['scans']:,}", f"{entry['detections']:,}"]
        if entry["first_detection"] is None:
            table.add_row(*(_cell(text) for text in [*counts, "never"]))
            continue
        for which in ("first", "last"):
            seen = entry[f"{which}_detection"]
            row = [
                *counts,
                which,
                time_text(seen["time_s"]),
                distance_text(seen["range_m"]),
                seen["target"],
            ]
            table.add_row(*(_cell(text) for text in row))
            counts = ["", "", ""]
    return table


def _fused(fused: dict[str, int]) -> Any:
    table = _table("Fused (per target and instant)")
    table.add_column("sensors")
    table.add_column("count", justify="right", no_wrap=True)
    for name, count in sorted(fused.items(), key=lambda item: (item[0].count("+"), item[0])):
        table.add_row(_cell(name), _cell(f"{count:,}"))
    return table


def _targets(targets: dict[str, Any]) -> list[Any]:
    table = _table("Closest approach")
    table.add_column("target")
    table.add_column(_cell("time [s]"), justify="right", no_wrap=True)
    table.add_column("range", justify="right", no_wrap=True)
    met = [
        (entry["closest_approach"], name)
        for name, entry in targets.items()
        if entry.get("closest_approach") is not None
    ]
    met.sort(key=lambda item: item[0]["range_m"])
    for approach, name in met[:MOST_TARGETS]:
        table.add_row(
            _cell(name),
            _cell(time_text(approach["time_s"])),
            _cell(distance_text(approach["range_m"])),
        )
    lines: list[Any] = [table] if met else []
    notes = []
    if len(met) > MOST_TARGETS:
        notes.append(f"{len(met) - MOST_TARGETS:,} farther targets are not listed")
    if len(met) < len(targets):
        notes.append(f"{len(targets) - len(met):,} targets were never there with the ownship")
    if notes:
        from rich.text import Text

        lines.append(Text("; ".join(notes) + "\n"))
    return lines
