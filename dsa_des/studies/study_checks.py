"""Checks of a study that need its scenes: every value of every axis, its draws and its metrics."""

from collections.abc import Callable
from typing import Any

from dsa_des.errors import BlockFailure, Problem, SceneError, did_you_mean
from dsa_des.replicas import scene_of
from dsa_des.scene import Scene
from dsa_des.scene_file import Key, SceneFile
from dsa_des.simulation import Simulation
from dsa_des.studies.metric import TRIALS, Metric, Result
from dsa_des.studies.study import Study


def check_cells(study: Study, file: SceneFile) -> None:
    """Check every value of every axis, the draws, and one run up to its first event.

    Raises
    ------
    SceneError
        With every problem found.
    """
    problems: list[Problem] = []

    def add(key: Key, message: str, *value: Any) -> None:
        problems.append(file.problem(key, message, *value))

    scenes: list[Scene] = []
    seen: set[str] = set()
    for cell in _one_per_value(study):
        try:
            scenes.append(study.scene(cell))
        except SceneError as error:
            for problem in error.problems:
                if str(problem) not in seen:
                    seen.add(str(problem))
                    problems.append(problem)
    _stop_if_wrong(problems)
    first = scenes[0]
    try:
        Simulation(scene_of(first, study.replica(0)))
    except SceneError as error:
        problems += error.problems
    except BlockFailure as error:
        add((), str(error))
    results: dict[str, Result] = {}
    for scene in _different(scenes):
        where = "" if scene is first else f" (with {_types(scene, first)})"
        for metric in _build_metrics(study, scene, where, add):
            if scene is first:
                for result in metric.results():
                    if result.name in results:
                        message = f"two metrics give the result {result.name}"
                        add(("metrics",), message)
                    results[result.name] = result
        if problems:
            break
    _stop_if_wrong(problems)
    names = [name for name in results if not name.endswith(TRIALS)]
    if study.stop_when and study.stop_when.metric not in names:
        message = f"no metric of the study gives it{did_you_mean(study.stop_when.metric, names)}"
        add(("stop_when", "metric"), message, study.stop_when.metric)
    for number, figure in enumerate(study.figures):
        if figure["kind"] != "run" and figure["metric"] not in names:
            message = "no metric of the study gives it"
            message += did_you_mean(str(figure["metric"]), names)
            add(("figures", number, "metric"), message, str(figure["metric"]))
    _stop_if_wrong(problems)


def _stop_if_wrong(problems: list[Problem]) -> None:
    if problems:
        raise SceneError(problems)


def _build_metrics(
    study: Study, scene: Scene, where: str, add: Callable[..., None]
) -> list[Metric]:
    """Return the study's metrics for a scene; what the scene lacks is a problem."""
    built: list[Metric] = []
    for number, spec in enumerate(study.metrics):
        try:
            built.append(spec.build(scene))
        except ValueError as error:
            add(("metrics", number), f"{error}{where}", spec.name)
    return built


def _one_per_value(study: Study) -> list[int]:
    """Return cells that together hold every value of every axis; the first cell comes first."""
    wanted = [(0,) * len(study.axes)]
    for place, axis in enumerate(study.axes):
        for index in range(1, len(axis.labels)):
            wanted.append(tuple(index if k == place else 0 for k in range(len(study.axes))))
    numbers = {cell: number for number, cell in enumerate(study.cells)}
    return [numbers[cell] for cell in wanted]


def _different(scenes: list[Scene]) -> list[Scene]:
    """Return one scene for every set of block types."""
    found: dict[tuple[Any, ...], Scene] = {}
    for scene in scenes:
        found.setdefault(tuple(sorted((n, c.path()) for n, c in scene.classes.items())), scene)
    return list(found.values())


def _types(scene: Scene, other: Scene) -> str:
    return ", ".join(
        f"{name} = {block.type_name}"
        for name, block in scene.blocks.items()
        if block.cls is not other.blocks[name].cls
    )
