"""``dsa-des compare``: the same encounters and draws under two or more conditions."""

import hashlib
import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.source_file import absolute_type_name
from dsa_des.commands.study import (
    check_workers,
    exit_if_runs_crashed,
    options_as_sets,
    print_and_redraw_study,
    run_study_into_folder,
    summarised_result_names,
    write_and_print_finished_study,
)
from dsa_des.commands.what_changed import ConditionPair, print_changes, print_changes_along_axis
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.files.output_file import write_file
from dsa_des.files.output_folder import make_results_folder
from dsa_des.results.curves import draw_scatter
from dsa_des.results.differences import (
    estimate_difference,
    paired_unit_means,
    second_minus_first_without_rounding,
)
from dsa_des.results.figures import safe_file_name
from dsa_des.results.folder import STUDY_JSON, StudyFolder
from dsa_des.results.labels import short_text
from dsa_des.results.printing import rounded_value_and_interval
from dsa_des.results.record import StudyRecord
from dsa_des.results.tables import Tables
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.scene import load_scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies.metric import METRICS
from dsa_des.studies.runner import result_tables_of_study
from dsa_des.studies.study import MetricSpec, Study, portable_command_line
from dsa_des.studies.study_digest import record_of, result_columns_of_study
from dsa_des.studies.study_file import read_study, study_of_scene
from dsa_des.terminal.tables import print_table
from dsa_des.terminal.terminal import console, say
from dsa_des.text.safe_text import shorten

_HOME = Path("studies")
#: A comparison is not continued.
_ANEW = "the same command and another --out: a comparison is begun anew"
_MOST_SHOWN = 5
_REPLICAS = 20


@dataclass(frozen=True)
class _OfAll:
    """The options of the command line that change every scene or study that is compared."""

    sets: tuple[str, ...]
    seed: int | None
    replicas: int | None

    def load_study(self, path: Path, swaps: Sequence[tuple[str, list[str]]] = ()) -> Study:
        """Return the study that a study file describes, or one made of a scene file."""
        if _is_study_file(path):
            sets = (*self.sets, *options_as_sets((), self.seed, self.replicas))
            return read_study(path, swaps, sets)
        replicas = _REPLICAS if self.replicas is None else self.replicas
        metrics = self._applicable_metrics(path, swaps)
        return study_of_scene(path, replicas, metrics, swaps, self.sets, self.seed or 0)

    def _applicable_metrics(self, path: Path, swaps: Sequence[tuple[str, list[str]]]) -> list[str]:
        """Return the metrics measurable in the scene as it is and with each of the swaps."""
        scenes = [load_scene(path, sets=self.sets)]
        for block, types in swaps:
            scenes.append(load_scene(path, sets=self.sets, swaps=[f"{block}={types[-1]}"]))
        metrics = []
        for name in entry_points_of(METRICS):
            try:
                for scene in scenes:
                    MetricSpec(name).build(scene)
            except ValueError:
                continue
            metrics.append(name)
        if not metrics:
            raise UsageError(f"{path}: no metric can be measured of this scene")
        return metrics


def compare_command(
    paths: tuple[str, ...],
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    replicas: int | None,
    results: tuple[str, ...],
    workers: int | None,
    out: str | None,
) -> None:
    """Run the scenes or studies that the command line names and print how their results differ."""
    if replicas is not None and replicas < 1:
        raise UsageError(f"--replicas is {replicas}: it must be 1 or more")
    check_workers(workers)
    changes = _OfAll(sets, seed, replicas)
    words = ["compare", *(word for swap in swaps for word in ("--swap", swap))]
    words += [] if seed is None else ["--seed", str(seed)]
    words += [] if replicas is None else ["--replicas", str(replicas)]
    if swaps:
        if len(paths) != 1:
            raise UsageError("--swap compares one scene or study with itself: name one file")
        file = find_input_file(paths[0])
        repeat = portable_command_line(words, sets, file)
        tables = _compare_swap(file, swaps, changes, results, workers, out, repeat)
        exit_if_runs_crashed(tables, _ANEW)
        return
    if len(paths) == 1 and os.path.lexists(Path(paths[0]) / STUDY_JSON):
        print_and_redraw_study(Path(paths[0]), results, _changes_printer(results))
        return
    if len(paths) < 2:
        raise UsageError("give two or more studies or scenes, or one and --swap BLOCK=TYPE")
    files = [find_input_file(path) for path in paths]
    studies = [_study_or_record_at_path(path, changes) for path in files]
    for study in studies:
        if isinstance(study, Study):
            study.repeat = portable_command_line(words, sets, *files)
    for study in studies:
        record = record_of(study) if isinstance(study, Study) else study
        summarised_result_names(record.results, results)
    by_path: dict[Path, Tables] = {}  # what is named twice is run once
    with make_results_folder(out, _HOME, "compare") as home:
        for file, study in zip(files, studies, strict=True):
            if file.resolve() not in by_path:
                by_path[file.resolve()] = _run_or_read_tables(file, study, workers, home)
        tables = [by_path[file.resolve()] for file in files]
        for number, (other, path) in enumerate(zip(tables[1:], paths[1:], strict=True), start=2):
            stem = "scatter" if len(tables) == 2 else f"scatter-{number}"
            _print_comparison(tables[0], other, (paths[0], path), results, home / stem)
    exit_if_runs_crashed(list(by_path.values()), _ANEW)


def _compare_swap(
    path: Path,
    swaps: Sequence[str],
    changes: _OfAll,
    results: Sequence[str],
    workers: int | None,
    out: str | None,
    repeat: str,
) -> list[Tables]:
    """Run a scene or study with and without swaps, and compare the two."""
    chosen: list[tuple[str, list[str]]] = []
    scene = (
        changes.load_study(path).scene(0)
        if _is_study_file(path)
        else load_scene(path, sets=changes.sets)
    )
    for swap in swaps:
        block, equals, name = swap.partition("=")
        if not equals or not name:
            raise UsageError(f"--swap {swap!r}: must have the form BLOCK=TYPE")
        name = absolute_type_name(name)
        if block not in scene.blocks:
            hint = did_you_mean(block, scene.blocks)
            raise UsageError(f"--swap {swap}: the scene has no block {block!r}{hint}")
        own = scene.blocks[block].type_name
        if own == name:
            raise UsageError(f"--swap {swap}: {block} is a {name} already")
        chosen.append((block, [own, name]))
    study = changes.load_study(path, chosen)
    study.repeat = repeat
    summarised_result_names(result_columns_of_study(study), results)
    with make_results_folder(out, _HOME, "compare") as home:
        folder = run_study_into_folder(study, home, workers, resume=False, again=_ANEW)
    tables = write_and_print_finished_study(
        study, folder, only=results, first=_changes_printer(results)
    )
    block, (own, _) = chosen[0]
    for value, _, base, rows in tables.rows.comparisons_with_baseline(f"swap.{block}", own):
        for metric in tables.names_of_scatter_results(results):
            _list_farthest_runs(
                metric, ConditionPair(tables, base, tables, rows), (own, str(value))
            )
    return [tables]


def _changes_printer(results: Sequence[str]) -> Callable[[Tables], None]:
    return lambda tables: print_changes_along_axis(tables, results)


def _is_study_file(path: Path) -> bool:
    data = read_scene_file(path).data
    return "scene" in data and "blocks" not in data


def _study_or_record_at_path(path: Path, changes: _OfAll) -> Study | StudyRecord:
    """Return the study of a study file or scene file, or the record of finished runs."""
    if not _is_folder(path):
        return changes.load_study(path)
    if changes.sets or changes.seed is not None or changes.replicas is not None:
        raise UsageError(
            f"{path}: is a folder of finished runs: --set, --seed and --replicas cannot change it"
        )
    return StudyFolder(path).record


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):  # a text that can be no path
        return False


def _run_or_read_tables(
    path: Path, study: Study | StudyRecord, workers: int | None, home: Path
) -> Tables:
    """Return result tables of a folder of finished runs, or run the study below `home` first."""
    if not isinstance(study, Study):
        return Tables(study, StudyFolder(path))
    number = hashlib.sha256(os.fsencode(path.resolve())).hexdigest()[:6]
    target = home / f"{path.stem[:100]}-{number}"
    folder = run_study_into_folder(study, target, workers, resume=False, again=_ANEW)
    return result_tables_of_study(study, folder)


def _results_to_show(tables: Tables, only: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(only or (line.result.name for line in tables.shown_lines())))


def _list_farthest_runs(metric: str, pair: ConditionPair, names: tuple[str, str]) -> None:
    """Print the runs in which two studies differ most in a result, with a command for each."""
    first, second = pair.paired_values(metric)
    known = np.flatnonzero(~np.isnan(first - second))
    changes = second_minus_first_without_rounding(first[known], second[known])
    changed = [
        (-abs(change), pair.keys[run], run)
        for change, run in zip(changes.tolist(), known.tolist(), strict=True)
        if change != 0.0
    ]
    if not changed:
        return
    say()
    say(f"{metric}: where {names[1]} differs most from {names[0]}")
    for _, key, run in sorted(changed)[:_MOST_SHOWN]:
        where = ", ".join(map(str, key[:-1])) + (", " if len(key) > 1 else "")
        change = f"{short_text(float(first[run]))} -> {short_text(float(second[run]))}"
        say(f"  {where}replica {key[-1]}: {change}")
        for tables, rows in zip(pair.tables, pair.rows, strict=True):
            say(f"    {tables.record.command(tables.rows.row(rows[run]))}")


def _print_comparison(
    one: Tables, other: Tables, names: tuple[str, str], only: Sequence[str], stem: Path
) -> None:
    """Print two studies' paired differences (`other` less `one`) at common axis values and runs,
    and draw the one against the other, a file per metric beside `stem`.
    """
    if one.rows.axes != other.rows.axes or one.rows.over != other.rows.over:
        raise UsageError(
            f"{names[0]} and {names[1]} have different axes ({one.rows.axes + one.rows.over} and "
            f"{other.rows.axes + other.rows.over}); only studies over the same ones can be paired"
        )
    if one.record.seed != other.record.seed:
        raise UsageError(
            f"{names[0]} has the seed {one.record.seed} and {names[1]} {other.record.seed}: their "
            "draws are not the same, so they cannot be paired"
        )
    kinds = {result.name: result.kind for result in other.results if result.is_number}
    own, known = ({result.name for result in side.results} for side in (one, other))
    metrics = [name for name in _results_to_show(one, only) if name in kinds]
    headings = [*one.rows.axes, "result", "difference", "paired interval", "pairs",
             "unpaired interval"]  # fmt: skip
    lines: list[list[str]] = []
    theirs = dict(other.rows.row_indices_by_axis_values())
    places: list[tuple[str, ConditionPair]] = []
    together: dict[str, list[tuple[Any, Any]]] = {}
    for at, rows in one.rows.row_indices_by_axis_values():
        if at not in theirs:
            continue
        runs = ConditionPair(one, rows, other, theirs[at])
        where = ", ".join(f"{n} = {short_text(v)}" for n, v in zip(one.rows.axes, at, strict=True))
        places.append((where, runs))
        names_of = [key[:-1] if one.rows.over else key for key in runs.keys]
        codes = {name: code for code, name in enumerate(dict.fromkeys(names_of))}
        units = np.array([codes[name] for name in names_of], dtype=np.int64)
        for metric in metrics:
            pair = paired_unit_means(units, *runs.paired_values(metric))[1:]
            d = estimate_difference(
                *pair, one.record.confidence, one.record.interval, kind=kinds[metric]
            )
            lines.append(
                [*map(short_text, at), metric, *rounded_value_and_interval(d.paired),
                str(d.paired.count),
                 rounded_value_and_interval(d.unpaired)[1].rstrip(" *")]
            )  # fmt: skip
            together.setdefault(metric, []).append(pair)
    shown = [r for r in one.results if r.name in known and (not only or r.name in only)]
    print_changes(names, places, shown)
    for who, there, others in ((names[0], one, known), (names[1], other, own)):
        alone = [r.name for r in there.results if r.name not in others]
        if alone:
            say(f"only {shorten(who)} has {shorten(', '.join(alone), 300)}")
    title = f"{names[1]} less {names[0]}, pair by pair"
    print_table(console(160), title, headings, lines, group=len(one.rows.axes))
    for _, runs in places:
        for metric in metrics:
            _list_farthest_runs(metric, runs, names)
    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        for metric, pairs in together.items():
            path = stem.with_name(f"{safe_file_name(f'{stem.name}-{metric}')}.png")
            x, y = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
            drawn = io.BytesIO()
            draw_scatter(drawn, x, y, names, metric, "compared")
            write_file(path, drawn.getvalue())
            say(f"wrote {path}")
    except OSError as error:
        raise UsageError(f"--out {stem.parent}: cannot be written: {error.strerror}") from error
