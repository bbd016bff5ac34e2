"""Checks of a study that need its scenes: every value of every axis, its draws and its metrics."""

import contextlib
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from dsa_des.errors import BlockFailure, Problem, SceneError, did_you_mean
from dsa_des.errors.budgets import MOST_STUDY_SCANS
from dsa_des.record.recording import Recorder
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.results.record import FRACTION, NUMBER, RATIO, SHARE, TRIALS, Result
from dsa_des.results.summary import numbers_by_series_result
from dsa_des.running.simulation import Simulation
from dsa_des.scene.keys import Key, parse_key_path
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import SceneFile
from dsa_des.studies.draws import Draw
from dsa_des.studies.foreseen_runs import allocation_refusal
from dsa_des.studies.metric import Metric, check_tables_recorded
from dsa_des.studies.splitting import SplitEvent, splitting_refusal
from dsa_des.studies.study import AUTO, Study

#: How many replicas the ends of a range are looked for in.
_MOST_DRAWN = 10_000
#: In so many scenes the last value of a sequence is tried.
_MOST_SCENES = 64


def check_axes_draws_and_run(study: Study, file: SceneFile, scene: Scene) -> None:
    """Check every value of every axis, the draws, and one run up to its first event.

    Problems are those of `file`, the study's, and the `scene` without axes is checked where no cell
    has one that fits. Names of results are checked only where the whole study could be read.
    """
    whole, before = not file.problems, len(file.problems)
    _report_keys_of_two_axes(study, file)
    scenes: list[Scene] = []
    for cell in cells_covering_values(study):
        try:
            scenes.append(study.scene(cell))
        except SceneError as error:
            file.problems += error.problems
    scenes = scenes or [scene]
    first = scenes[0]
    _check_draws(study, first, file)
    results: dict[str, Result] = {}
    for one in _one_scene_per_block_types(scenes):
        where = "" if one is first else f" (with {_differing_types_text(one, first)})"
        built = _build_metrics(study, one, where, file)
        if one is first:
            for metric in built:
                for result in metric.results():
                    if result.name in results:
                        file.report(("metrics",), f"two metrics give the result {result.name}")
                    results[result.name] = result
        if len(built) < len(study.metrics):
            whole = False
            break
    if whole:
        _check_result_names(study, results, file)
    if whole and study.splitting is not None:
        split_event = study.metrics[0].build(first)
        assert isinstance(split_event, SplitEvent)
        if wrong := splitting_refusal(study.splitting, split_event, study.metrics[0].name):
            key, said, value = wrong
            at = ("splitting", key) if key else ("splitting",)
            file.report(at, said, *([value] if key else []))
    if len(file.problems) == before:
        _check_set_up(study, scenes, file)
    if len(file.problems) == before:
        _check_last_of_sequences(study, scenes, file)
    if len(file.problems) == before and study.allocate:
        try:
            why_not = allocation_refusal(study, first)
        except (SceneError, ValueError) as error:
            why_not = str(error)
        if why_not:
            file.report(("allocate",), why_not)


def _check_last_of_sequences(study: Study, scenes: list[Scene], file: SceneFile) -> None:
    """Set up a run with each sequence draw's last value; report failures, as a file too short."""
    last = study.runs_started_per_cell - 1
    for draw in study.draws:
        if draw.kind != "sequence" or not last:
            continue
        value = draw.value(study.seed, last, study.replicas_per_batch)
        for scene in scenes[:_MOST_SCENES]:
            try:
                _ = Simulation(replica_scene(scene, Replica(0, {draw.key: value}))).components
            except SceneError as error:
                text = "; ".join(problem.message for problem in error.problems)
            except BlockFailure as error:
                text = str(error)
            else:
                continue
            file.report(
                ("draws", draw.key),
                f"of the last of {study.runs_started_per_cell} replicas: {text}",
                value,
            )
            break


def _explain_too_many_scans(study: Study, scans: float) -> str:
    """Return why a study with so many scans per run is too large to start; empty if it is not."""
    runs = study.runs_started_per_cell * len(study.cells)
    if runs * scans <= MOST_STUDY_SCANS:
        return ""
    return (
        f"{runs:,} runs of {scans:.2g} scans are {runs * scans:.2g} scans in all: at most "
        f"{MOST_STUDY_SCANS:.0e} are begun, {int(MOST_STUDY_SCANS / scans):,} runs like these"
    )


def _check_set_up(study: Study, scenes: list[Scene], file: SceneFile) -> None:
    """Set up a run, and report what is wrong with it or with the metrics.

    Where a metric needs something of the blocks, one scene of the study that has it is enough. Of
    many files one may be damaged: its runs fail by themselves.
    """
    files = any(axis.files for axis in study.axes)
    broken: list[Problem] = []
    wrong: dict[int, str] | None = None
    for scene in scenes:
        try:
            recorder = Recorder([], wanted=dict.fromkeys(_tables_read(study, scene), ()))
            simulation = Simulation(replica_scene(scene, study.replica(0)), recorder=recorder)
            if wrong is None and (said := _explain_too_many_scans(study, simulation.scans)):
                file.report(("replicas",), said)
                return
            blocks = simulation.components
        except (SceneError, BlockFailure) as error:
            if wrong is None:
                if isinstance(error, SceneError):
                    broken += error.problems
                else:
                    broken.append(file.problem((), str(error)))
                if not files:
                    break
            continue
        refused: dict[int, str] = {}
        for spec in study.metrics:
            try:
                if wrong is None or spec.index in wrong:
                    metric = spec.build(scene)
                    check_tables_recorded(metric, blocks)
                    metric.check(blocks)
            except ValueError as error:
                refused[spec.index] = str(error)
        wrong = refused
        if not wrong:
            break
    if wrong is None:
        file.problems += broken
    names = {spec.index: spec.name for spec in study.metrics}
    for k, text in (wrong or {}).items():
        file.report(("metrics", k), text, names[k])


def _check_result_names(study: Study, results: Mapping[str, Result], file: SceneFile) -> None:
    """Report result names that no metric produces, and figures that cannot show their results."""
    names = [n for n, r in results.items() if not n.endswith(TRIALS) and r.is_summarised]

    def report_unknown_result(key: Key, name: str) -> None:
        file.report(key, f"no metric of the study gives it{did_you_mean(name, names)}", name)

    if study.stop_when and study.stop_when.metric not in names:
        report_unknown_result(("stop_when", "metric"), study.stop_when.metric)
    weight = study.compare_weight
    if weight is not None and (weight not in results or results[weight].kind != NUMBER):
        message = f"no metric of the study gives such a number{did_you_mean(weight, names)}"
        file.report(("compare", "weight"), message, weight)
    ratios = [name for name in names if results[name].kind == RATIO]
    for name in study.allocate:
        if name != AUTO and name not in ratios:
            message = f"no ratio of the study has that name{did_you_mean(name, [AUTO, *ratios])}"
            file.report(("allocate",), message, name)
    for number, wanted in enumerate(study.requirements):
        if wanted.metric not in names:
            report_unknown_result(("requirements", number, "metric"), wanted.metric)
    for number, figure in enumerate(study.figures):
        if figure.kind == "series":
            if not numbers_by_series_result(str(figure.metric), results):
                message = "there are no such results with a number behind them (NAME.5, NAME.10)"
                file.report(("figures", number, "metric"), message, str(figure.metric))
        elif figure.kind != "run" and figure.metric not in names:
            report_unknown_result(("figures", number, "metric"), str(figure.metric))
        elif figure.kind in ("histogram", "cdf") and (
            results[str(figure.metric)].kind not in (NUMBER, FRACTION, SHARE)
        ):
            spread = (NUMBER, FRACTION, SHARE)
            numbers = [name for name in names if results[name].kind in spread]
            what = {"event": "an event, 0 or 1"}.get(results[str(figure.metric)].kind, "a ratio")
            message = f"is {what}: a {figure.kind} shows how numbers are spread"
            message += f"; numbers are {', '.join(numbers[:4])}" if numbers else ""
            file.report(("figures", number, "metric"), message, str(figure.metric))


def _report_keys_of_two_axes(study: Study, file: SceneFile) -> None:
    """Report keys that two axes set, of which the second would silently win."""
    owner: dict[tuple[str | int, ...], str] = {}
    for axis in study.axes:
        for key in {key for sets in axis.sets for key, _ in sets}:
            first = owner.setdefault(parse_key_path(study.base.data, key), axis.key)
            if first != axis.key:
                file.report(("axes", axis.key), f"sets {key}, which the axis {first} sets as well")


def _check_draws(study: Study, scene: Scene, file: SceneFile) -> None:
    """Report draws whose values the scene does not allow, and draws of keys that are axes."""
    tables = study.base.data
    on_axes = {
        parse_key_path(tables, key): axis.key
        for axis in study.axes
        for sets in axis.sets
        for key, _ in sets
    }
    for draw in study.draws:
        if axis := on_axes.get(parse_key_path(tables, draw.key)):
            file.report(("draws", draw.key), f"is set by the axis {axis}: draw it, or vary it")
        for value in _extreme_drawn_values(draw, study):
            try:
                replica_scene(scene, Replica(0, {draw.key: value}))
            except SceneError as error:
                for problem in error.problems:
                    shown = float(value) if isinstance(value, Fraction) else value
                    file.report(("draws", draw.key), problem.message, shown)
                if draw.kind != "choice":
                    break


def _extreme_drawn_values(draw: Draw, study: Study) -> list[Any]:
    """Return the drawn values that are to be checked: the extreme ones, or all of a choice.

    Those of a normal distribution have no ends: a replica that draws too far out fails by itself.
    """
    if draw.kind == "choice":
        return list(draw.values)
    if draw.kind == "sequence":
        return [
            draw.value(study.seed, number, study.replicas_per_batch)
            for number in (0, study.runs_started_per_cell - 1)
        ]
    count = 1 if draw.kind == "normal" else min(study.replicas, _MOST_DRAWN)
    cells = study.cells if study.over else range(1)
    seeds = dict.fromkeys(map(study.member_seed, cells[: max(1, _MOST_DRAWN // count)]))
    drawn = [
        draw.value(seed, number, study.replicas_per_batch)
        for seed in seeds
        for number in range(count)
    ]
    return list(dict.fromkeys([min(drawn), max(drawn)]))


def _build_metrics(study: Study, scene: Scene, where: str, file: SceneFile) -> list[Metric]:
    """Return the study's metrics built for a scene; those that fail are reported and left out."""
    built: list[Metric] = []
    for spec in study.metrics:
        try:
            built.append(spec.build(scene))
        except ValueError as error:
            file.report(("metrics", spec.index), f"{error}{where}", spec.name)
    return built


def _tables_read(study: Study, scene: Scene) -> set[str]:
    """Return the names of tables that metrics read; metrics that cannot be built are left out."""
    tables: set[str] = set()
    for spec in study.metrics:
        with contextlib.suppress(ValueError):
            tables.update(spec.build(scene).tables)
    return tables


def cells_covering_values(study: Study) -> list[int]:
    """Return cells that together hold every value of every axis; the first cell comes first."""
    wanted = [(0,) * len(study.axes)]
    for position, axis in enumerate(study.axes):
        for index in range(1, len(axis.labels)):
            wanted.append(tuple(index if k == position else 0 for k in range(len(study.axes))))
    return [study.cell_at(indices) for indices in wanted]


def _one_scene_per_block_types(scenes: list[Scene]) -> list[Scene]:
    """Return one scene for every distinct assignment of types to blocks."""
    by_types: dict[tuple[Any, ...], Scene] = {}
    for scene in scenes:
        by_types.setdefault(
            tuple(sorted((n, c.import_path()) for n, c in scene.classes.items())), scene
        )
    return list(by_types.values())


def _differing_types_text(scene: Scene, other: Scene) -> str:
    return ", ".join(
        f"{name} = {block.type_name}"
        for name, block in scene.blocks.items()
        if block.cls is not other.blocks[name].cls
    )
