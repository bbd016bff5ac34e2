"""From a study file to a study that can be run, every problem reported before anything runs."""

import math
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dsa_des.block.component import SourcedText
from dsa_des.block.entry_points import registered
from dsa_des.block.source_file import absolute
from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.errors.budgets import MOST_CELLS, MOST_RUNS
from dsa_des.results.record import StopWhen
from dsa_des.scene.examples import find_example
from dsa_des.scene.keys import Key, flat
from dsa_des.scene.overrides import apply_sets, read_sets
from dsa_des.scene.parameter_errors import explain
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import SceneFile, read_scene_file
from dsa_des.studies.axes import Axis, flatten_axes, label_of, parse_axis
from dsa_des.studies.draws import Draw, flatten_draws, parse_draw
from dsa_des.studies.metric import METRICS, find_metric
from dsa_des.studies.study import MetricSpec, Study, changed_scene
from dsa_des.studies.study_checks import cell_problems
from dsa_des.studies.study_tables import read_figures, read_requirements, resolved

KEYS = (
    "title", "description", "scene", "set", "swap", "seed", "replicas", "axes", "draws", "metrics",
    "figures", "requirements", "stop_when", "compare", "over", "confidence", "interval",
    "runs_per_chunk",
)  # fmt: skip


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
    reader = _StudyReader(read_scene_file(path))
    reader.data.update(keys or {})
    reader.problems += apply_sets(reader.file, sets)
    return reader.study(swaps)


def study_of_scene(
    scene: Path,
    replicas: int,
    metrics: Iterable[str],
    swaps: Iterable[tuple[str, list[str]]] = (),
    sets: Iterable[str] = (),
    seed: int = 0,
) -> Study:
    """Return a study of a scene with some of its values set: some replicas, the named metrics."""
    values, problems = read_sets(sets)
    if problems:
        raise SceneError(problems)
    data = {
        "title": scene.stem,
        "scene": SourcedText.of(str(scene.resolve()), scene.parent),
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
    """Return a study of a scene that was read already.

    `tables` are as a study file would hold them, without ``scene``, ``set`` and ``swap``; `swaps`
    and `sets` are made in every cell.
    """
    return _StudyReader(SceneFile(Path("study"), tables), base, swaps, sets).study(())


class _StudyReader:
    """Reads a study; its scene, and changes of every cell, may be given beside its tables."""

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
        self.problems: list[Problem] = []
        #: Columns of axes that are wrong in themselves.
        self.unread: list[str] = []

    def add(self, key: Key, message: str, *value: Any) -> None:
        self.problems.append(self.file.problem(key, message, *value))

    def study(self, swaps: Iterable[tuple[str, list[str]]]) -> Study:
        for key, message in (
            (
                "blocks",
                "is a scene, not a study: dsa-des run takes it, dsa-des compare runs it often",
            ),
            ("study", "is a case, not a study: dsa-des evidence takes it"),
        ):
            if self._base is None and "scene" not in self.data and key in self.data:
                raise SceneError([Problem(str(self.file.path), "", message)])
        for key in self.data:
            if key not in KEYS:
                self.add((key,), f"unknown key of a study{did_you_mean(key, KEYS)}")
        seed = self.whole("seed", 0, low=0)
        replicas = self.whole("replicas", 1, low=1)
        confidence = self.number("confidence", 0.95, 0.5, 1.0)
        interval = self.data.get("interval", "t")
        if interval not in ("t", "bootstrap"):
            self.add(("interval",), "must be 't' or 'bootstrap'", interval)
        draws = self.draws()
        specs = self.metric_specs()
        stop_when = self.stop_when(replicas)
        base, scene = self.scene()
        if base is None or scene is None:  # all else is checked against this scene
            raise SceneError(self.problems)
        axes = self.axes(scene, swaps)
        cells = math.prod(len(axis.labels) for axis in axes)
        runs = replicas * cells
        if cells > MOST_CELLS:
            self.add(("axes",), f"make {cells:,} cells; at most {MOST_CELLS:,} are allowed")
            raise SceneError(self.problems)
        if runs > MOST_RUNS:
            runs_are = f"{cells:,} cells make {runs:,} runs" if runs < 10**18 else "are too many"
            self.add(("replicas",), f"{runs_are}; at most {MOST_RUNS:,} runs are allowed")
            raise SceneError(self.problems)
        study = Study(
            path=Path(self.file.path),
            scene_path=Path(base.path),
            title=str(self.data.get("title", Path(self.file.path).stem)),
            seed=seed,
            replicas=replicas,
            axes=axes,
            draws=draws,
            metrics=specs,
            sets=self.sets(),
            swaps=self.swaps(),
            over=self.over(axes),
            baseline=self.baseline(axes),
            stop_when=stop_when,
            confidence=confidence,
            interval=interval,
            figures=read_figures(
                self.data.get("figures", []), axes, replicas, self.column, self.add
            ),
            compare_weight=self.compare_weight(),
            requirements=read_requirements(
                self.data.get("requirements", []), axes, self.column, self.add
            ),
            runs_per_chunk=self.whole("runs_per_chunk", max(1, min(512, -(-runs // 32))), low=1),
            base=base,
            tables=resolved(self.data, swaps),
        )
        self.problems += cell_problems(study, self.file, scene, whole=not self.problems)
        if self.problems:
            raise SceneError({str(problem): problem for problem in self.problems}.values())
        return study

    # -- plain values ----------------------------------------------------------------------

    def whole(self, key: str, default: int, *, low: int) -> int:
        value = self.data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < low:
            self.add((key,), f"must be a whole number of {low} or more", value)
            return max(default, low)
        return value

    def number(self, key: str, default: float, low: float, high: float) -> float:
        value = self.data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low < value < high:
            self.add((key,), f"must be a number between {low} and {high}", value)
            return default
        return float(value)

    def table(self, key: str) -> dict[str, Any]:
        value = self.data.get(key, {})
        if not isinstance(value, dict):
            self.add((key,), "must be a table", value)
            return {}
        return value

    def sets(self) -> tuple[tuple[str, Any], ...]:
        return (*self._sets, *flat(self.table("set")).items())

    def swaps(self) -> tuple[tuple[str, str], ...]:
        named = [
            (block, str(absolute(name)) if isinstance(name, str) else str(name))
            for block, name in self.table("swap").items()
        ]
        return (*self._swaps, *named)

    # -- the base scene --------------------------------------------------------------------

    def scene(self) -> tuple[SceneFile | None, Scene | None]:
        if self._base is not None:
            return self.checked(self._base)
        name = self.data.get("scene")
        if not isinstance(name, str):
            self.add(("scene",), "is required: the TOML file of the scene that is studied")
            return None, None
        try:
            path = Path(str(name)).expanduser()
        except RuntimeError as error:  # the ~ of an unknown user
            self.add(("scene",), str(error), name)
            return None, None
        if not path.is_absolute():
            path = getattr(name, "folder", Path()) / path
        try:
            if not os.path.lexists(path):
                path = find_example(str(name), "scene") or path
            base = read_scene_file(path)
        except SceneError as error:
            self.problems += error.problems
            return None, None
        return self.checked(base)

    def checked(self, base: SceneFile) -> tuple[SceneFile | None, Scene | None]:
        for swaps, sets in ((self.swaps(), self.sets()), ((), ())):
            try:
                return base, changed_scene(base, swaps, sets, str(self.file.path))
            except SceneError as error:  # all else is then checked against the scene as it is
                known = {str(problem) for problem in self.problems}
                self.problems += [one for one in error.problems if str(one) not in known]
        return None, None

    # -- axes and draws --------------------------------------------------------------------

    def axes(self, scene: Scene, swaps: Iterable[tuple[str, list[str]]]) -> tuple[Axis, ...]:
        axes: list[Axis] = []
        specs = flatten_axes(self.table("axes")) | {f"swap.{b}": types for b, types in swaps}
        for key, spec in specs.items():
            try:
                axes.append(parse_axis(key, spec, scene))
            except ValueError as error:
                self.add(("axes", key), str(error))
                self.unread.append(key.removeprefix("blocks."))
        return tuple(axes)

    def draws(self) -> tuple[Draw, ...]:
        draws = []
        for key, spec in flatten_draws(self.table("draws")).items():
            try:
                draws.append(parse_draw(key, spec))
            except ValueError as error:
                self.add(("draws", key), str(error))
        return tuple(draws)

    def column(self, key: Key, name: Any, axes: tuple[Axis, ...]) -> str | None:
        """Return the column of the axis that `name` means."""
        columns = [axis.column for axis in axes]
        wanted = str(name).removeprefix("blocks.")
        if wanted in columns:
            return wanted
        if wanted in self.unread:
            return None
        hint = did_you_mean(wanted, columns)
        self.add(key, f"the study has no such axis{hint}", str(name))
        return None

    def over(self, axes: tuple[Axis, ...]) -> tuple[str, ...]:
        if "over" not in self.data:
            return tuple(axis.column for axis in axes if axis.files)
        names = self.data["over"]
        names = names if isinstance(names, list) else [names]
        return tuple(c for n in names if (c := self.column(("over",), n, axes)) is not None)

    def baseline(self, axes: tuple[Axis, ...]) -> tuple[str, Any] | None:
        table = self.data.get("compare")
        if table is None:
            first = next((axis for axis in axes if axis.key.startswith("swap.")), None)
            return None if first is None else (first.column, first.labels[0])
        known = {"axis", "baseline"}
        if not isinstance(table, dict) or not known <= set(table) <= {*known, "weight"}:
            message = "must be a table {axis = KEY, baseline = VALUE}"
            self.add(("compare",), f"{message}, with weight = RESULT where units have one")
            return None
        column = self.column(("compare", "axis"), table["axis"], axes)
        if column is None:
            return None
        axis = next(axis for axis in axes if axis.column == column)
        wanted = table["baseline"]
        try:
            known_so = wanted in axis.labels and not isinstance(wanted, bool)
            label = wanted if known_so else label_of(wanted)
        except ValueError:
            label = wanted
        if label not in axis.labels:
            shown = ", ".join(map(str, axis.labels[:12]))
            message = f"is no value of that axis; allowed: {shown}"
            self.add(("compare", "baseline"), message, wanted)
            return None
        return column, axis.labels[axis.labels.index(label)]

    def compare_weight(self) -> str | None:
        table = self.data.get("compare")
        weight = table.get("weight") if isinstance(table, dict) else None
        if weight is not None and not isinstance(weight, str):
            self.add(("compare", "weight"), "must be the name of a result", weight)
            return None
        return None if weight is None else str(weight)

    # -- metrics ---------------------------------------------------------------------------

    def metric_specs(self) -> tuple[MetricSpec, ...]:
        items = self.data.get("metrics")
        if not isinstance(items, list) or not items:
            shown = ", ".join(registered(METRICS))
            self.add(("metrics",), f"is required: a list of metrics; there are {shown}")
            return ()
        specs: list[MetricSpec] = []
        for number, item in enumerate(items):
            key: Key = ("metrics", number)
            table = {"metric": item} if isinstance(item, str) else item
            if not isinstance(table, dict) or not isinstance(table.get("metric"), str):
                self.add(key, "must be the name of a metric, or a table {metric = NAME, ...}", item)
                continue
            keys = {name: value for name, value in table.items() if name != "metric"}
            name = absolute(table["metric"])
            try:
                cls = find_metric(name)
                cls.Parameters.model_validate(keys)
            except ValidationError as error:
                self.problems += explain(self.file, key, f"metric {name}", cls.Parameters, error)
                continue
            except ValueError as error:
                self.add(key, str(error), name)
                continue
            specs.append(MetricSpec(name, keys, number))
        return tuple(specs)

    def stop_when(self, replicas: int) -> StopWhen | None:
        table = self.data.get("stop_when")
        if table is None:
            return None
        known = {"metric", "half_width", "batch"}
        if not isinstance(table, dict) or not {"metric", "half_width"} <= set(table) <= known:
            self.add(("stop_when",), "must be {metric = RESULT, half_width = NUMBER, batch = N}")
            return None
        if not isinstance(table["metric"], str):
            self.add(("stop_when", "metric"), "must be the name of a result", table["metric"])
            return None
        width, batch = table["half_width"], table.get("batch", max(10, -(-replicas // 20)))
        number = isinstance(width, int | float) and not isinstance(width, bool)
        if not number or not 0 < width <= sys.float_info.max:
            self.add(("stop_when", "half_width"), "must be a finite number above 0", width)
            return None
        if isinstance(batch, bool) or not isinstance(batch, int) or batch < 2:
            self.add(("stop_when", "batch"), "must be a whole number of 2 or more", batch)
            return None
        return StopWhen(str(table["metric"]), float(width), min(batch, replicas))
