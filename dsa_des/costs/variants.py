"""A scene with another rung in one of its blocks, everything else as it was."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsa_des.block.ladder import Ladder, Rung, Unavailable
from dsa_des.errors import SceneError
from dsa_des.scene.overrides import apply_changes, read_changes, swap_type
from dsa_des.scene.scene import Scene, check_scene
from dsa_des.scene.scene_file import COMMAND_LINE, SceneFile, read_scene_file

#: Lets the engine replace models by itself; a rung must be what it says.
_CHOOSES_BY_ITSELF = "accuracy"


@dataclass(frozen=True)
class Choice:
    """A rung of a ladder for one block."""

    block: str
    ladder: Ladder
    rung: Rung


class Variants:
    """Makes scenes that differ from one scene by the rungs of their blocks.

    ``[accuracy]`` is left out of all of them, since it lets the engine choose rungs by itself.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        sets: Iterable[str] = (),
        swaps: Iterable[str] = (),
        seed: int | None = None,
        duration_s: object = None,
    ) -> None:
        scene_file = read_scene_file(path)
        changes, scene_file.problems = read_changes(sets, swaps, seed, duration_s)
        self.dropped = apply_changes(scene_file, changes)
        for key in ("changes", "outages"):
            if key in scene_file.data:
                message = f'costs are of a scene that stays as it is: remove = ["{key}"]'
                scene_file.report((key,), message)
        stated = check_scene(scene_file.copy())
        #: What ``[accuracy]`` of the scene allows.
        self.tolerance: Mapping[str, float] = stated.tolerance
        scene_file.data.pop(_CHOOSES_BY_ITSELF, None)
        self._file = scene_file
        self.scene = self.with_rungs(())
        self._blocks: dict[str, dict[str, Any]] = self.scene.resolved()["blocks"]

    def with_rungs(self, choices: Iterable[Choice], shared: Iterable[Choice] = ()) -> Scene:
        """Return the scene with these rungs in their blocks.

        Of rungs `shared` only the `Rung.shared` parameters are set, after `choices`.
        """
        scene_file = self._file.copy()
        for choice in choices:
            self._apply_choice(scene_file, choice)
        for choice in shared:
            _set_parameters(scene_file, choice.block, choice.rung.shared)
        try:
            return check_scene(scene_file)
        except SceneError as error:
            raise Unavailable(
                "; ".join(_short_problem_text(problem) for problem in error.problems)
            ) from error

    def _apply_choice(self, scene_file: SceneFile, choice: Choice) -> None:
        block = scene_file.data["blocks"][choice.block]
        for key in choice.ladder.clears:
            block.pop(key, None)
        values = choice.rung.parameters_to_set(self._blocks[choice.block])
        if choice.rung.type_name:
            swap_type(scene_file, choice.block, choice.rung.type_name, COMMAND_LINE)
            if scene_file.problems:
                raise Unavailable(
                    "; ".join(_short_problem_text(problem) for problem in scene_file.problems)
                )
        _set_parameters(scene_file, choice.block, values)
        for table, keys in choice.rung.sections.items():
            for key, value in keys.items():
                scene_file.data.setdefault(table, {})[key] = value
                scene_file.sources[(table, key)] = COMMAND_LINE


def _set_parameters(scene_file: SceneFile, block: str, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        scene_file.data["blocks"][block][key] = value
        scene_file.sources[("blocks", block, key)] = COMMAND_LINE


def _short_problem_text(problem: Any) -> str:
    return f"{problem.key}: {problem.message}" if problem.key else str(problem.message)
