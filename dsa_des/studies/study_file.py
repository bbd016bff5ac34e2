"""From a study file to a study that can be run, every problem reported before anything runs."""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dsa_des.block.component import SourcedText
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.source_file import absolute_type_name
from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.errors.budgets import MOST_CELLS, MOST_RUNS
from dsa_des.results.record import Requirement, StopWhen
from dsa_des.scene.checks import parse_table, report_silent_conversions
from dsa_des.scene.examples import find_example
from dsa_des.scene.keys import Key, flatten_tables
from dsa_des.scene.overrides import SWAP, apply_sets, read_sets
from dsa_des.scene.parameter_errors import explain_validation_error
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import SceneFile, read_scene_file
from dsa_des.studies.axes import Axis, axis_value_label, flatten_axes, parse_axis
from dsa_des.studies.draws import Draw, flatten_draws, parse_draw
from dsa_des.studies.metric import METRICS, find_metric
from dsa_des.studies.splitting import Splitting
from dsa_des.studies.study import MetricSpec, Study, changed_scene
from dsa_des.studies.study_checks import check_axes_draws_and_run
from dsa_des.studies.study_tables import (
    CompareTable,
    RequirementTable,
    SplittingTable,
    StopWhenTable,
    StudyKeys,
    read_figures,
    resolve_tables,
)


def read_study(
    path: Path | str,
    swaps: Iterable[tuple[str, list[str]]] = (),
    sets: Iterable[str] = (),
    keys: Mapping[str, Any] | None = None,
) -> Study:
    """Read and check a study.

    `swaps` are further swap axes; `sets` change the study itself, as ``key=value``; `keys` take the
    place of its own.
    """
    file = read_scene_file(path)
    file.data.update(keys or {})
    apply_sets(file, sets)
    return _StudyReader(file).study(swaps)


def study_of_scene(
    scene: Path,
    replicas: int,
    metrics: Iterable[str],
    swaps: Iterable[tuple[str, list[str]]] = (),
    sets: Iterable[str] = (),
    seed: int = 0,
) -> Study:
    """Return a study of replicas of one scene, with values set, measuring the named metrics."""
    values, problems = read_sets(sets)
    if problems:
        raise SceneError(problems)
    data = {
        "title": scene.stem,
        "scene": SourcedText.from_text(str(scene.resolve()), scene.parent),
        "replicas": replicas,
        "seed": seed,
        "metrics": list(metrics),
    }
    return _StudyReader(SceneFile(scene, data), sets=values).study(swaps)


def study_of_tables(
    tables: dict[str, Any],
    base: SceneFile,
    swaps: Sequence[tuple[str, str]],
    sets: Sequence[tuple[str, Any]],
) -> Study:
    """Return a study of a scene whose tables were read already.

    `tables` are as a study file would hold them, without ``scene``, ``set`` and ``swap``; `swaps`
    and `sets` are made in every cell.
    """
    return _StudyReader(SceneFile(Path("study"), tables), base, swaps, sets).study(())


def _as_list(names: str | list[str]) -> list[str]:
    return [names] if isinstance(names, str) else names


class _StudyReader:
    """Builds a study from its tables; scene and changes for each cell may be given separately."""

    def __init__(
        self,
        file: SceneFile,
        base: SceneFile | None = None,
        swaps: Sequence[tuple[str, str]] = (),
        sets: Sequence[tuple[str, Any]] = (),
    ) -> None:
        self._base, self._swaps, self._sets = base, swaps, sets
        self.file = file
        self.data = file.data
        self.keys = StudyKeys()
        #: Columns of axes that are wrong in themselves.
        self.unread: list[str] = []

    def study(self, swaps: Iterable[tuple[str, list[str]]]) -> Study:
        file = self.file
        for key, message in (
            (
                "blocks",
                "is a scene, not a study: dsa-des run takes it, dsa-des compare runs it often",
            ),
            ("study", "is a case, not a study: dsa-des evidence takes it"),
        ):
            if self._base is None and "scene" not in self.data and key in self.data:
                raise SceneError([Problem(str(file.path), "", message)])
        keys = self.keys = self.checked_keys()
        draws = self.draws()
        splitting = self.splitting()
        specs = self.metric_specs(splitting)
        stop_when = self.stop_when()
        base, scene = self.scene()
        if base is None or scene is None:  # all else is checked against this scene
            raise SceneError(file.problems)
        axes = self.axes(scene, swaps)
        cells = math.prod(len(axis.labels) for axis in axes)
        runs = keys.replicas * cells
        if cells > MOST_CELLS:
            file.report(("axes",), f"make {cells:,} cells; at most {MOST_CELLS:,} are allowed")
            raise SceneError(file.problems)
        if runs > MOST_RUNS:
            runs_are = f"{cells:,} cells make {runs:,} runs" if runs < 10**18 else "are too many"
            file.report(("replicas",), f"{runs_are}; at most {MOST_RUNS:,} runs are allowed")
            raise SceneError(file.problems)
        baseline, weight = self.read_baseline_and_weight(axes)
        study = Study(
            path=Path(file.path),
            scene_path=Path(base.path),
            title=Path(file.path).stem if keys.title is None else str(keys.title),
            seed=keys.seed,
            replicas=keys.replicas,
            axes=axes,
            draws=draws,
            metrics=specs,
            sets=self.sets(),
            swaps=self.swaps(),
            over=self.sampled_axis_columns(axes),
            baseline=baseline,
            stop_when=stop_when,
            confidence=keys.confidence,
            interval=keys.interval,
            figures=read_figures(
                file,
                keys.figures,
                axes,
                {"cell": cells, "replica": keys.replicas},
                lambda key, name: self.results_column_of_axis(key, name, axes),
            ),
            compare_weight=weight,
            requirements=self.requirements(axes),
            splitting=splitting,
            allocate=() if keys.allocate is None else tuple(_as_list(keys.allocate)),
            runs_per_chunk=keys.runs_per_chunk or max(1, min(1024, -(-runs // 16))),
            base=base,
            tables=resolve_tables(self.data, swaps),
        )
        check_axes_draws_and_run(study, file, scene)
        file.raise_if_problems()
        return study

    def checked_keys(self) -> StudyKeys:
        """Return the study's keys; wrong ones are reported and replaced by their defaults."""
        try:
            keys = StudyKeys.model_validate(self.data)
        except ValidationError as error:
            self.file.problems += explain_validation_error(
                self.file, (), "a study", StudyKeys, error
            )
            wrong = {item["loc"][0] for item in error.errors(include_url=False)}
            sound = {key: value for key, value in self.data.items() if key not in wrong}
            keys = StudyKeys.model_validate(sound)
        report_silent_conversions(self.file, (), self.data, keys)
        for key, value in flatten_tables(keys.set).items():
            if key.startswith(SWAP):
                self.file.report(
                    ("set", key), f"types are changed in [swap]: {key[5:]} = ...", value
                )
        return keys

    def sets(self) -> tuple[tuple[str, Any], ...]:
        values = {k: v for k, v in flatten_tables(self.keys.set).items() if not k.startswith(SWAP)}
        return (*self._sets, *values.items())

    def swaps(self) -> tuple[tuple[str, str], ...]:
        named = [
            (block, str(absolute_type_name(name)) if isinstance(name, str) else str(name))
            for block, name in self.keys.swap.items()
        ]
        return (*self._swaps, *named)

    # -- the base scene --------------------------------------------------------------------

    def scene(self) -> tuple[SceneFile | None, Scene | None]:
        if self._base is not None:
            return self.checked_base_scene(self._base)
        name = self.keys.scene
        if not isinstance(name, str):
            self.file.report(("scene",), "is required: the TOML file of the scene that is studied")
            return None, None
        try:
            path = Path(str(name)).expanduser()
        except RuntimeError as error:  # the ~ of an unknown user
            self.file.report(("scene",), str(error), name)
            return None, None
        if not path.is_absolute():
            path = getattr(name, "folder", Path()) / path
        try:
            if not os.path.lexists(path):
                path = find_example(str(name), "scene") or path
            base = read_scene_file(path)
        except SceneError as error:
            self.file.problems += error.problems
            return None, None
        return self.checked_base_scene(base)

    def checked_base_scene(self, base: SceneFile) -> tuple[SceneFile | None, Scene | None]:
        for swaps, sets in ((self.swaps(), self.sets()), ((), ())):
            try:
                return base, changed_scene(base, swaps, sets, str(self.file.path))
            except SceneError as error:  # all else is then checked against the scene as it is
                known = {str(problem) for problem in self.file.problems}
                self.file.problems += [one for one in error.problems if str(one) not in known]
        return None, None

    # -- axes and draws --------------------------------------------------------------------

    def axes(self, scene: Scene, swaps: Iterable[tuple[str, list[str]]]) -> tuple[Axis, ...]:
        axes: list[Axis] = []
        specs = flatten_axes(self.keys.axes) | {f"swap.{b}": types for b, types in swaps}
        for key, spec in specs.items():
            try:
                axes.append(parse_axis(key, spec, scene))
            except ValueError as error:
                self.file.report(("axes", key), str(error))
                self.unread.append(key.removeprefix("blocks."))
        return tuple(axes)

    def draws(self) -> tuple[Draw, ...]:
        draws = []
        for key, spec in flatten_draws(self.keys.draws).items():
            try:
                draws.append(parse_draw(key, spec))
            except ValueError as error:
                self.file.report(("draws", key), str(error))
        return tuple(draws)

    def results_column_of_axis(self, key: Key, name: Any, axes: tuple[Axis, ...]) -> str | None:
        """Return the results column of axis `name`; None, with a report, if there is none."""
        columns = [axis.column for axis in axes]
        wanted = str(name).removeprefix("blocks.")
        if wanted in columns:
            return wanted
        if wanted in self.unread:
            return None
        hint = did_you_mean(wanted, columns)
        self.file.report(key, f"the study has no such axis{hint}", str(name))
        return None

    def sampled_axis_columns(self, axes: tuple[Axis, ...]) -> tuple[str, ...]:
        names = self.keys.over
        if names is None:
            return tuple(axis.column for axis in axes if axis.files)
        names = [names] if isinstance(names, str) else names
        return tuple(
            c for n in names if (c := self.results_column_of_axis(("over",), n, axes)) is not None
        )

    def read_baseline_and_weight(
        self, axes: tuple[Axis, ...]
    ) -> tuple[tuple[str, Any] | None, str | None]:
        """Return the comparison's (axis column, baseline) and weight result; None if not given."""
        if self.keys.compare is None:
            first = next((axis for axis in axes if axis.key.startswith("swap.")), None)
            return None if first is None else (first.column, first.labels[0]), None
        table = parse_table(self.file, ("compare",), CompareTable, self.keys.compare)
        if table is None:
            return None, None
        column = self.results_column_of_axis(("compare", "axis"), table.axis, axes)
        if column is None:
            return None, table.weight
        axis = next(axis for axis in axes if axis.column == column)
        wanted = table.baseline
        try:
            known_so = wanted in axis.labels and not isinstance(wanted, bool)
            label = wanted if known_so else axis_value_label(wanted)
        except ValueError:
            label = wanted
        if label not in axis.labels:
            shown = ", ".join(map(str, axis.labels[:12]))
            message = f"is no value of that axis; allowed: {shown}"
            self.file.report(("compare", "baseline"), message, wanted)
            return None, table.weight
        return (column, axis.labels[axis.labels.index(label)]), table.weight

    def requirements(self, axes: tuple[Axis, ...]) -> tuple[Requirement, ...]:
        requirements: list[Requirement] = []
        for number, item in enumerate(self.keys.requirements):
            key: Key = ("requirements", number)
            asked = parse_table(self.file, key, RequirementTable, item)
            if asked is None:
                continue
            limit, below = (asked.least, False) if asked.most is None else (asked.most, True)
            along = self.results_column_of_axis((*key, "axis"), asked.axis, axes)
            if along is not None and limit is not None:
                last = asked.cheaper == "last"
                requirements.append(Requirement(asked.metric, along, limit, below, last))
        return tuple(requirements)

    # -- metrics ---------------------------------------------------------------------------

    def metric_specs(self, splitting: Splitting | None) -> tuple[MetricSpec, ...]:
        items = self.keys.metrics
        if not isinstance(items, list) or not items:
            shown = ", ".join(entry_points_of(METRICS))
            self.file.report(("metrics",), f"is required: a list of metrics; there are {shown}")
            return ()
        event = splitting.event if splitting is not None and len(items) == 1 else ""
        specs: list[MetricSpec] = []
        for number, item in enumerate(items):
            key: Key = ("metrics", number)
            table = {"metric": item} if isinstance(item, str) else item
            if not isinstance(table, dict) or not isinstance(table.get("metric"), str):
                self.file.report(
                    key, "must be the name of a metric, or a table {metric = NAME, ...}", item
                )
                continue
            keys = {name: value for name, value in table.items() if name != "metric"}
            name = absolute_type_name(table["metric"])
            try:
                model = find_metric(name).Parameters
            except ValueError as error:
                self.file.report(key, str(error), name)
                continue
            if parse_table(self.file, key, model, keys, f"metric {name}") is not None:
                specs.append(MetricSpec(name, keys, number, event))
        if splitting is not None and len(items) > 1:
            said = "splitting is for one event: leave the one metric that gives it"
            self.file.report(("metrics",), said)
        return tuple(specs)

    def splitting(self) -> Splitting | None:
        """Return the settings of splitting; None if there are none, or wrong ones (reported)."""
        if self.keys.splitting is None:
            return None
        table = parse_table(self.file, ("splitting",), SplittingTable, self.keys.splitting)
        if self.keys.replicas < 2:
            said = "are the repetitions of splitting: its interval needs 2 or more, better 20"
            self.file.report(("replicas",), said, self.keys.replicas)
        for key, other in (("allocate", self.keys.allocate), ("over", self.keys.over)):
            if other is not None:
                self.file.report((key,), "does not go with splitting")
        if table is None:
            return None
        levels = None if table.levels is None else tuple(table.levels)
        return Splitting(table.event, table.score, table.runs, levels)

    def stop_when(self) -> StopWhen | None:
        if self.keys.stop_when is None:
            return None
        table = parse_table(self.file, ("stop_when",), StopWhenTable, self.keys.stop_when)
        if table is None:
            return None
        replicas = self.keys.replicas
        batch = table.batch or max(10, -(-replicas // 20))
        return StopWhen(table.metric, table.half_width, min(batch, replicas))
