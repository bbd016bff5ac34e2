"""``dsa-des encounters convert``, ``show`` and ``split``: what is done with sets."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from components.encounters.encounter_tables import numbers_and_errors, read_table, select_good_rows
from components.encounters.model_commands import check_origin
from components.encounters.splitting import (
    expected_copy_counts,
    least_miss_in_nmac_sizes,
    split_set,
)
from components.formats.encounter_set import EncounterSet, geometry_class
from components.formats.public_formats import SET, WAYPOINTS, read_encounters, waypoint_file_bytes
from components.formats.recorded.encounter_tracks import recorded_tracks
from components.formats.set_file import EncounterSetError, read_set, write_set
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.errors import OutputError, UsageError
from dsa_des.errors.budgets import check_sample_count
from dsa_des.files.input_files import InputFileError, resolve_home
from dsa_des.files.output_file import PICTURES, check_file_ending, check_file_writable, write_file
from dsa_des.files.output_names import system_error_text, user_path
from dsa_des.terminal.tables import print_table
from dsa_des.terminal.terminal import console, say


def convert_sets(
    files: tuple[str, ...],
    weights: str | None,
    at: tuple[float, float] | None,
    skip_damaged: bool,
    out: str,
) -> None:
    """Read files of encounters and write them as one set, or as a file of waypoints."""
    if at is not None:
        check_origin(at)
    path = user_path(out)
    if path.suffix.lower() not in (SET, *WAYPOINTS):
        raise UsageError(f"--out {out}: must end in {SET}, or in {' or '.join(WAYPOINTS)}")
    check_file_writable(path)
    try:
        encounters = read_encounters(
            [resolve_home(text) for text in files], at, skip_damaged, recorded_tracks
        )
        if weights is not None:
            options = "--weights", "--weights"
            new = _value_by_encounter(encounters, weights, "weight", *options, least=False)
            if not (new > 0.0).any():
                raise UsageError(f"{weights}: all weights are 0")
            encounters = replace(encounters, weights=new)
        if path.suffix.lower() == SET:
            write_set(path, {"made_by": "conversion"}, [encounters])
        else:
            write_file(path, waypoint_file_bytes(encounters))
    except InputFileError as error:
        raise UsageError(str(error)) from None
    except EncounterSetError as error:
        raise UsageError(*str(error).split("\n")) from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {system_error_text(error)}") from error
    say(f"{path}: {len(encounters)} encounters")
    _print_notes_on_set(encounters)


def _print_notes_on_set(encounters: EncounterSet) -> None:
    """Print how many damaged encounters were skipped, and the notes on changes while reading."""
    if encounters.skipped:
        say(f"{encounters.skipped} damaged encounters were skipped")
    for note in encounters.notes[:_MOST_NOTES]:
        say(f"note: {note}", err=True)
    if len(encounters.notes) > _MOST_NOTES:
        say(f"note: and {len(encounters.notes) - _MOST_NOTES} more", err=True)


def _value_by_encounter(
    encounters: EncounterSet, text: str, column: str, *options: str, least: bool
) -> FloatArray:
    """Return each encounter's value in a table's column; of several rows the least or the last.

    `options` of the command line ask for the columns ``encounter`` and `column`.
    """
    table = read_table(text)
    number, wrong = numbers_and_errors(table, "encounter", options[0], flag=False)
    value, also = numbers_and_errors(table, column, options[1], flag=False)
    select_good_rows(table, [wrong, also], skip=False)
    known: dict[int, float] = {}
    for n, v in zip(number.astype(np.int64).tolist(), value.tolist(), strict=True):
        known[n] = min(v, known.get(n, math.inf)) if least else v
    missing = [n for n in encounters.numbers.tolist() if n not in known]
    if missing:
        raise UsageError(f"{text}: encounter {missing[0]}: {column} is missing")
    return np.array([known[n] for n in encounters.numbers.tolist()])


_DRAWN, _MOST_NOTES = 12, 20


@dataclass(frozen=True)
class Closest:
    """Figures of the closest approaches to the nearest intruder, one element per encounter.

    Vertical is intruder above ownship, closing the relative speed, the course that of the intruder
    against the ownship's, all at that time.
    """

    weight: FloatArray
    horizontal_m: FloatArray
    vertical_m: FloatArray
    time_s: FloatArray
    closing_mps: FloatArray
    course_deg: FloatArray


def closest_approaches(encounters: EncounterSet, indices: Sequence[int]) -> Closest:
    """Return figures of encounters' closest approaches, exact if straight between samples."""
    rows = [_closest_approach_figures(encounters, index) for index in indices]
    return Closest(encounters.weights[list(indices)], *np.array(rows).T)


def _closest_approach_figures(encounters: EncounterSet, index: int) -> tuple[float, ...]:
    best: tuple[float, tuple[float, ...]] = (math.inf, (math.nan,) * 5)
    for both, a, b in encounters.common_times_and_positions(index):
        if len(both) < 2:
            continue
        apart, step = b - a, np.diff(b - a)
        length = (step * step).sum(axis=0)
        share = -(apart[:, :-1] * step).sum(axis=0) / np.where(length > 0.0, length, 1.0)
        share = np.clip(share, 0.0, 1.0)
        at = apart[:, :-1] + share * step
        k = int(np.argmin((at * at).sum(axis=0)))
        duration = both[k + 1] - both[k]
        ways = [np.diff(p[:2, k : k + 2])[:, 0] for p in (a, b)]
        courses = [math.degrees(math.atan2(way[1], way[0])) for way in ways]
        found_here = (
            float(np.hypot(at[0, k], at[1, k])), float(at[2, k]),
            float(both[k] + share[k] * duration), float(math.sqrt(length[k]) / duration),
            (courses[1] - courses[0]) % 360.0,
        )  # fmt: skip
        distance = float((at[:, k] ** 2).sum())
        best = min(best, (distance, found_here), key=lambda one: one[0])
    return best[1]


def print_set_statistics(
    files: tuple[str, ...], most: int, figure: str | None, skip_damaged: bool
) -> None:
    """Print a set's encounters: number, weights, closest approaches; draw them on request."""
    path = None if figure is None else user_path(figure, "--figure")
    if path is not None:
        check_file_ending(path, PICTURES, "--figure")
        check_file_writable(path, "--figure")
    try:
        encounters = read_encounters(
            [resolve_home(text) for text in files], None, skip_damaged, recorded_tracks
        )
    except (EncounterSetError, InputFileError) as error:
        raise UsageError(*str(error).split("\n")) from None
    indices = np.unique(
        np.linspace(0, len(encounters) - 1, min(most, len(encounters))).astype(int)
    ).tolist()
    closest = closest_approaches(encounters, indices)
    total, squares = math.fsum(encounters.weights), math.fsum(encounters.weights**2)
    say(
        f"{encounters.source}: {len(encounters)} encounters of {encounters.kind}, "
        f"{len(encounters.names)} flights"
    )
    say(f"sum of weights {total:.6g}, effective sample size {total**2 / squares:.1f}" if squares
        else "all weights are 0")  # fmt: skip
    _print_notes_on_set(encounters)
    if len(indices) < len(encounters):
        say(f"closest approaches of {len(indices)} of them, evenly spread")
    headings = ["at the closest approach", "5 %", "median", "95 %", "weighted mean"]
    print_table(console(), "", headings, _statistics_rows(closest), right=range(1, 5))
    print_table(console(), "", ["geometry", "encounters", "share of the weight"],
                _geometry_rows(closest), right=range(1, 3))  # fmt: skip
    if path is not None:
        try:
            _draw_set(encounters, indices, closest, path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {system_error_text(error)}") from error
        say(f"{path}")


def _statistics_rows(c: Closest) -> list[list[str]]:
    rows = []
    for name, values in (
        ("horizontal, m", c.horizontal_m), ("vertical, m", c.vertical_m), ("time, s", c.time_s),
        ("relative speed (m/s)", c.closing_mps),
    ):  # fmt: skip
        good = np.isfinite(values)
        weight = c.weight[good]
        mean = (weight * values[good]).sum() / weight.sum() if weight.sum() > 0 else math.nan
        spread = np.quantile(values[good], [0.05, 0.5, 0.95]) if good.any() else [math.nan] * 3
        rows.append([name, *(f"{v:.4g}" for v in (*spread, mean))])
    return rows


def _geometry_rows(c: Closest) -> list[list[str]]:
    kinds: AnyArray = geometry_class(c.course_deg)
    total = c.weight.sum() or 1.0
    return [
        [str(kind), str(int((kinds == kind).sum())), f"{c.weight[kinds == kind].sum() / total:.3f}"]
        for kind in np.unique(kinds)
    ]


def _draw_set(encounters: EncounterSet, indices: list[int], c: Closest, path: Path) -> None:
    """Draw histograms of closest approaches, plain and weighted, and sample paths from above."""
    from dsa_des.record.drawing import draw_to_png

    with draw_to_png(11.0, 6.5, path) as figure:
        axes: Any = figure.subplots(2, 3)
        parts = (
            ("horizontal distance (m)", c.horizontal_m), ("vertical distance (m)", c.vertical_m),
            ("time of the closest approach (s)", c.time_s), ("relative speed (m/s)", c.closing_mps),
            ("course against the ownship's (deg)", c.course_deg),
        )  # fmt: skip
        weight = c.weight / c.weight.sum() if c.weight.sum() > 0 else None
        for axis, (name, values) in zip(axes.flat, parts, strict=False):
            good = np.isfinite(values)
            middle = float(np.mean(values[good])) if good.any() else 0.0
            near = bool(np.ptp(values[good]) < 1e-2) if good.any() else False
            edges = np.histogram_bin_edges(
                values[good], 24, (middle - 0.5, middle + 0.5) if near else None
            )
            share = np.full(int(good.sum()), 1.0 / max(int(good.sum()), 1))
            axis.hist(values[good], edges, weights=share, color="#9ecae1", label="encounters")
            if weight is not None:
                axis.hist(values[good], edges, weights=weight[good], histtype="step",
                          color="#d94801", label="weighted")  # fmt: skip
            axis.set_xlabel(name)
            axis.set_ylabel("share of the encounters")
        axes.flat[0].legend()
        plan = axes.flat[5]
        for index in indices[:: max(1, len(indices) // _DRAWN)][:_DRAWN]:
            rows = range(int(encounters.first_rows[index]), int(encounters.first_rows[index + 1]))
            for k, row in enumerate(rows):
                _, north, east, _ = encounters.path(row)
                plan.plot(
                    east / 1000, north / 1000, lw=0.8, color="#08519c" if k == 0 else "#d94801"
                )
        plan.set_aspect("equal", adjustable="datalim")
        plan.set_xlabel("east (km)")
        plan.set_ylabel("north (km)")
        plan.set_title("plan of a sample (ownship blue)")
        figure.tight_layout()


def split_encounters(
    file: str,
    levels: str,
    copies: str,
    scores: str | None,
    score: str | None,
    seed: int,
    out: str,
) -> None:
    """Write a set with copies of encounters near the event, their weights divided accordingly."""
    if (scores is None) != (score is None):
        raise UsageError("--scores TABLE and --score COLUMN belong together: give both, or neither")
    path = user_path(out)
    check_file_ending(path, [SET])
    check_file_writable(path)
    try:
        encounters = read_set(resolve_home(file))
    except (EncounterSetError, InputFileError) as error:
        raise UsageError(*str(error).split("\n")) from None
    if scores is None or score is None:
        near = np.array(
            [least_miss_in_nmac_sizes(encounters, index) for index in range(len(encounters))]
        )
    else:
        near = _value_by_encounter(encounters, scores, score, "--scores", "--score", least=True)
    try:
        expected = expected_copy_counts(
            near, _parse_numbers("--levels", levels), _parse_numbers("--copies", copies)
        )
    except ValueError as error:
        raise UsageError(f"--levels {levels} --copies {copies}: {error}") from None
    lengths = np.diff(encounters.starts[encounters.first_rows])
    check_sample_count(f"--copies {copies}", float(np.sum(expected * lengths)))
    made = split_set(encounters, expected, seed)
    if not len(made):
        raise UsageError(f"{file}: no encounter is left; more copies are needed")
    write_set(path, {"made_by": "splitting", "of": str(file), "seed": seed}, [made])
    families = len(np.unique(made.extra["family"]))
    say(f"{path}: {len(made)} encounters, copies of {families} of {len(encounters)}")
    sums = math.fsum(made.weights), math.fsum(encounters.weights)
    say(f"sum of weights {sums[0]:.6g}, of the set {sums[1]:.6g}")


def _parse_numbers(option: str, text: str) -> FloatArray:
    try:
        return np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise UsageError(f"{option} {text}: must be numbers with commas between them") from None
