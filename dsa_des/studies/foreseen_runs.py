"""What is known of a study's runs before they are flown, and which of them are flown.

Between the columns of a study's parts and the arrays of `dsa_des.studies.allocation`: metrics
foresee nominal events, weights and geometry; ratios say which columns are events.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.foreign_calls import error_text_with_type, is_stop_request
from dsa_des.replicas.changed_scene import Replica
from dsa_des.results.folder import StudyFolder
from dsa_des.results.record import (
    EVENT,
    RATIO,
    STANDS_FOR,
    RatioOf,
    Result,
    geometry_column,
    predicted_column,
)
from dsa_des.results.rows import Rows, StoredRows
from dsa_des.scene.scene import Scene
from dsa_des.studies.allocation import (
    FIRST_LEAST,
    LEAST,
    PILOT,
    UNTOLD,
    Allocation,
    ForeseenRuns,
    learn_allocation,
    sample_runs_to_fly,
)
from dsa_des.studies.draws import uniform_of_replica
from dsa_des.studies.metric import Group, Metric, expected_column, measure_one_by_one
from dsa_des.studies.study import AUTO, Study

#: Runs that are foreseen at a time, at most: few enough for the memory, many for the work.
_AT_ONCE = 4096


def geometry_names(metrics: Sequence[Metric]) -> list[str]:
    """Return the names of quantities known before flight, with those of predicted events."""
    names = dict.fromkeys(name for metric in metrics for name in metric.geometry)
    ratios = [one.ratio for metric in metrics for one in metric.results() if one.ratio is not None]
    return [*names, *dict.fromkeys(predicted_column(of.above) for of in ratios if names)]


def allocation_refusal(study: Study, scene: Scene) -> str:
    """Return why a study cannot be answered from a sample of its runs; empty if it can."""
    metrics = {spec.name: spec.build(scene) for spec in study.metrics}
    blind = [name for name, one in metrics.items() if type(one).foresee is Metric.foresee]
    if blind:
        return (
            f"{', '.join(blind)} can tell nothing of a run that is not flown: only metrics that "
            "foresee a run (risk_ratio, encounter_weight) go with a sample of the runs"
        )
    if not geometry_names(list(metrics.values())):
        return "no metric of the study tells encounters apart by their geometry: add risk_ratio"
    if study.over:
        return f"goes with replicas, and not with a sample along an axis ({', '.join(study.over)})"
    known = predict_results(scene, list(metrics.values()), [study.replica(0)])
    for one in metrics.values():
        for result in one.results():
            if result.name not in known and result.kind not in (EVENT, RATIO):
                return f"{result.name} is no event, and only known of runs that are flown"
    return ""


def ratios_to_optimise(results: Sequence[Result], allocate: Sequence[str]) -> list[Result]:
    """Return the ratios that `allocate` names; with ``auto`` all that cover every class of runs."""
    ratios = [result for result in results if result.ratio is not None]
    if AUTO in allocate:
        return [one for one in ratios if one.ratio is not None and one.ratio.only is None]
    return [one for one in ratios if one.name in allocate]


def predict_results(
    scene: Scene, metrics: Sequence[Metric], replicas: Sequence[Replica]
) -> dict[str, AnyArray]:
    """Return result or geometry column → each replica's values as known without flying it."""
    parts: dict[str, list[AnyArray]] = {}
    batches = max(1, math.ceil(len(replicas) / _AT_ONCE))
    for k in range(batches):
        start, end = (len(replicas) * n // batches for n in (k, k + 1))
        group = Group(scene, replicas[start:end], (), {})
        mine: dict[str, AnyArray] = {}
        for metric in metrics:
            for name, values in metric.foresee(group).items():
                column = geometry_column(name) if name in metric.geometry else name
                mine.setdefault(column, values)
        for name, values in mine.items():
            parts.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in parts.items()}


def predict_results_and_errors(
    scene: Scene, metrics: Sequence[Metric], replicas: Sequence[Replica]
) -> tuple[dict[str, AnyArray], dict[int, str]]:
    """Return column → values known without flying, and replica index → error if there are none."""
    try:
        return predict_results(scene, metrics, replicas), {}
    except BaseException as error:
        if is_stop_request(error):
            raise
        if len(replicas) == 1:
            return {}, {0: f"before it is flown: {error_text_with_type(error)}"}
    return measure_one_by_one(partial(predict_results_and_errors, scene, metrics), replicas)


def sample_weights_and_predictions(
    study: Study,
    cell: int,
    numbers: Sequence[int],
    plan: Allocation | None,
    results: Sequence[Result],
    columns: Mapping[str, AnyArray],
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Draw runs to fly; return runs each stands for, (runs,), or 0, and column → predicted events.

    Whether a run is flown depends on its seed and on what is known of it, and on no other run.
    """
    if plan is None or not columns:  # nothing is known of runs that are all in error
        return np.ones(len(numbers)), {}
    ratios = [
        one.ratio for one in ratios_to_optimise(results, study.allocate) if one.ratio is not None
    ]
    seed = study.member_seed(cell)
    draws = [uniform_of_replica(seed, "study allocation", number) for number in numbers]
    known = _foreseen_runs(columns, ratios)
    predicted: dict[str, FloatArray] = {}
    for of, chance in zip(ratios, plan.predicted_event_chances(known), strict=True):
        name = geometry_column(predicted_column(of.above))
        predicted[name] = np.maximum(predicted.get(name, 0.0), chance)
    return sample_runs_to_fly(plan.probabilities(known), draws)[1], predicted


def _foreseen_runs(columns: Mapping[str, Any], ratios: Sequence[RatioOf]) -> ForeseenRuns:
    chances = [geometry_column(expected_column(of.above)) for of in ratios]
    names = sorted(name for name in columns if name.startswith(geometry_column("")))
    chance = tuple(geometry_column(of("")) for of in (expected_column, predicted_column))
    geometry = [columns[name] for name in names if not name.startswith(chance)]
    weights = [np.ones(len(geometry[0])) if of.weight is None else columns[of.weight]
               for of in ratios]  # fmt: skip
    return ForeseenRuns(
        np.array(geometry, dtype=np.float64),
        np.array([_event_flags_in_class(columns, of, columns[of.below]) for of in ratios]),
        np.array(
            [
                columns[name] if name in columns else np.full(len(weights[0]), UNTOLD)
                for name in chances
            ]
        ),
        np.array(weights[0], dtype=np.float64),
    )


def _event_flags_in_class(columns: Mapping[str, Any], of: RatioOf, flags: AnyArray) -> FloatArray:
    """Return an event's flags as 0 or 1; 0 where missing or outside the ratio's class."""
    result: FloatArray = np.nan_to_num(flags.astype(np.float64))
    return result if of.only is None else result * (columns[of.only[0]] == of.only[1])


def allocations_of_round(
    study: Study, folder: StudyFolder, number: int, first: int, cells: Sequence[int]
) -> dict[int, Allocation]:
    """Return cell → plan for the round from replica `first`, learnt from rounds before `number`."""
    if not study.allocate:
        return {}
    ratios = [
        one.ratio
        for one in ratios_to_optimise(folder.record.results, study.allocate)
        if one.ratio is not None
    ]
    if first == 0:
        first_plans = {cell: _first_plan(study, cell, ratios) for cell in cells}
        return {cell: plan for cell, plan in first_plans.items() if plan is not None}
    rows = Rows(StoredRows(folder, before_round=number), ["cell"], [])
    read = {geometry_column(name) for name in folder.record.geometry}
    read |= {name for of in ratios for name in of.columns_read()}
    plans = {}
    for (cell,), chosen in rows.row_indices_by_axis_values():
        if cell not in cells:
            continue
        columns = {name: rows.column(name)[chosen] for name in read}
        stood = rows.column(STANDS_FOR)[chosen]
        if not (stood > 0.0).any():
            continue
        happened = [_event_flags_in_class(columns, of, columns[of.above]) for of in ratios]
        least = LEAST if first >= PILOT else FIRST_LEAST
        plans[int(cell)] = learn_allocation(
            _foreseen_runs(columns, ratios), np.array(happened), stood, least
        )
    return plans


def _first_plan(study: Study, cell: int, ratios: Sequence[RatioOf]) -> Allocation | None:
    """Return a cell's first sampling plan, from expected chances only; None if all are flown."""
    replicas = [study.replica(n, cell) for n in range(min(PILOT, study.round_ends[0]))]
    try:
        scene = study.scene(cell)
        columns = predict_results(scene, [spec.build(scene) for spec in study.metrics], replicas)
    except Exception:  # the rows of its runs say what is wrong
        return None
    none = np.zeros(len(replicas))
    return learn_allocation(
        _foreseen_runs(columns, ratios), np.zeros((len(ratios), len(none))), none, FIRST_LEAST
    )
