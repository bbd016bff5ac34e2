"""What a study's scene is made of, kept beside its results: ``explained.json``.

Which model each block uses and how large its error can be, which effects are simulated and which
are left out and why, and with what versions the runs were made. It is written when the study is
begun, so that its report can tell all of it without reading a scene.
"""

import json
import math
import platform
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from dsa_des.block.ladder import Ladder, Unavailable
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.files.toml_files import to_toml
from dsa_des.record.version import __version__
from dsa_des.replicas.changed_scene import scene_of
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene
from dsa_des.studies.labels import short
from dsa_des.studies.record import StrictRecord
from dsa_des.studies.safe_files import read_regular
from dsa_des.studies.study_checks import one_per_value

if TYPE_CHECKING:
    from dsa_des.studies.folder import StudyFolder
    from dsa_des.studies.study import Study

EXPLAINED = "explained.json"
_PACKAGES = ("numpy", "scipy", "pyarrow", "simpy", "networkx", "pydantic", "numba")
#: Cells that are looked at: the first, and one for each value of an axis.
_MOST_CELLS = 12
_MOST_BYTES = 16 * 2**20


class ModelRecord(StrictRecord):
    """A block: its type, what that is, and the rungs of accuracy that it stands on."""

    block: str
    type: str
    about: str
    #: ``earth: ellipsoid, exact on WGS 84 (the reference)``.
    rungs: list[str]


class EffectRecord(StrictRecord):
    """An effect that is simulated or left out, and because of what."""

    block: str
    effect: str
    simulated: bool
    because: str
    #: Largest influence that is proven, by quantity.
    bound: dict[str, float] = {}


class SceneRecord(StrictRecord):
    """The scene of a cell; of cells after the first, only what is not so in the first."""

    where: str
    models: list[ModelRecord]
    effects: list[EffectRecord]
    #: What work blocks spare themselves, and why results allow it.
    spared: list[tuple[str, str]]


class Explained(StrictRecord):
    """What a study's runs are made of."""

    versions: dict[str, str]
    #: The first run's scene with every default written out, as TOML.
    scene: str
    scenes: list[SceneRecord]


def versions() -> dict[str, str]:
    """Return the versions of this program, of Python and of the packages it computes with."""
    found = {"dsa_des": __version__, "Python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def explained(study: "Study") -> Explained:
    """Return of what a study's runs are made."""
    scenes: list[SceneRecord] = []
    text = ""
    for cell in one_per_value(study)[:_MOST_CELLS]:
        labels = study.labels(cell)
        where = ", ".join(f"{name} = {short(value)}" for name, value in labels.items())
        try:
            scene = scene_of(study.scene(cell), study.replica(0, cell))
            found = _of_scene(where, scene)
            text = text or to_toml(scene.resolved())
        except (SceneError, BlockFailure, ValueError):
            continue  # its rows say why
        scenes.append(_less(found, scenes[0]) if scenes else found)
    told = [one for one in scenes if one.models or one.effects or one.spared]
    return Explained(versions=versions(), scene=text, scenes=told)


def _of_scene(where: str, scene: Scene) -> SceneRecord:
    simulation = Simulation(scene)
    models, spared = [], []
    for name, component in simulation.components.items():
        block = scene.blocks[name]
        about = (type(component).__doc__ or "").strip().partition("\n")[0]
        rungs = [_rung(scene, name, ladder) for ladder in block.cls.ladders_for(block.parameters)]
        models.append(
            ModelRecord(
                block=name, type=block.type_name, about=about, rungs=list(filter(None, rungs))
            )
        )
        spared += [(name, sentence) for sentence in component.left_out()]
    effects = [
        EffectRecord(
            block=item.block, effect=item.effect.name, simulated=item.built, because=item.because,
            bound={k: float(v) for k, v in item.verdict.bound.items() if math.isfinite(v)},
        )
        for item in [*simulation.plan, *simulation.timing_plan]
    ]  # fmt: skip
    return SceneRecord(where=where, models=models, effects=effects, spared=spared)


def _rung(scene: Scene, name: str, ladder: Ladder) -> str:
    """Return which rung of a ladder a block is, as far as its type and keys tell."""
    block = scene.blocks[name]
    table = scene.resolved()["blocks"][name]
    best = ""
    for rung in ladder.rungs:
        try:
            changes = rung.changes(table)
        except Unavailable:
            continue
        same = rung.type_name in ("", block.type_name) and all(
            getattr(scene.sections.get(section), key, None) == value
            for section, keys in rung.sections.items()
            for key, value in keys.items()
        )
        if same and all(table.get(key) == value for key, value in changes.items()):
            reference = " (the reference)" if rung.name == ladder.reference else ""
            best = f"{ladder.name}: {rung.name}, {rung.what}{reference}"
            if changes or rung.type_name or rung.sections:
                return best
    return best


def _less(found: SceneRecord, first: SceneRecord) -> SceneRecord:
    """Return what is not so in the first scene."""

    def new(some: Iterable[Any], known: list[Any]) -> list[Any]:
        return [one for one in some if one not in known]

    return SceneRecord(
        where=found.where,
        models=new(found.models, first.models),
        effects=new(found.effects, first.effects),
        spared=new(found.spared, first.spared),
    )


def keep_explained(study: "Study", folder: "StudyFolder") -> None:
    """Write ``explained.json`` into a study's folder, unless it is there.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    if read_explained(folder) is None:
        content = explained(study).model_dump()
        text = json.dumps(content, indent=1, allow_nan=False) + "\n"
        folder.write_file(EXPLAINED, text.encode())


def read_explained(folder: "StudyFolder") -> Explained | None:
    """Return what a folder says of its scene; None where it says nothing that can be used."""
    try:
        return Explained.model_validate_json(read_regular(folder.path / EXPLAINED, _MOST_BYTES))
    except (OSError, ValidationError):
        return None
