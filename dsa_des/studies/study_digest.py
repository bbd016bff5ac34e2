"""What fixes a study's results, by its digest, and of what its runs are made.

It is the content of ``study.json`` and ``explained.json``.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from dsa_des.block.mark import Mark, plot_mark_by_name
from dsa_des.block.source_file import (
    absolute_file_path,
    file_of_module,
    is_python_file_path,
    split_type_name,
)
from dsa_des.costs.models import scene_record
from dsa_des.errors import BlockFailure, SceneError, UsageError
from dsa_des.files.input_files import resolve_home
from dsa_des.files.output_folder import RUN_JSON
from dsa_des.files.toml_files import to_toml
from dsa_des.record.version import __version__
from dsa_des.replicas.changed_scene import replica_scene
from dsa_des.results.folder import StudyFolder
from dsa_des.results.labels import short_text
from dsa_des.results.models import (
    EXPLAINED,
    Explained,
    SceneRecord,
    package_versions,
    read_explained,
)
from dsa_des.results.record import Result, StudyRecord, draw_column
from dsa_des.scene.keys import readable_key
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies.axes import Axis
from dsa_des.studies.draws import file_sha256
from dsa_des.studies.foreseen_runs import geometry_names
from dsa_des.studies.study import Study, format_set_value
from dsa_des.studies.study_checks import cells_covering_values
from dsa_des.studies.study_tables import json_safe

#: Cells that are looked at: the first, and one for each value of an axis.
_MOST_CELLS = 12
#: Texts for people, which name no file.
_PROSE = ("title", "description", "labels")


def study_json_text(study: Study) -> str:
    """Return the text of ``study.json``: the record, and a hash of what determines results."""
    identity: dict[str, Any] = {
        "scene": study.base.data,
        "seed": study.seed,
        "replicas": study.replicas,
        "axes": [[axis.key, axis.labels, axis.sets, axis.swaps] for axis in study.axes],
        "draws": [[draw.key, draw.kind, draw.values, draw.stratified] for draw in study.draws],
        "metrics": [[spec.name, spec.keys] for spec in study.metrics],
        "sets": study.sets,
        "swaps": study.swaps,
        "runs_per_chunk": study.runs_per_chunk,
        "stop_when": None if study.stop_when is None else vars(study.stop_when),
        "version": __version__,
    }
    if study.over:  # each member of a sample has seeds and draws of its own
        identity["over"] = sorted(study.over)
    if study.allocate:
        identity["allocate"] = study.allocate
    if study.splitting is not None:
        identity["splitting"] = vars(study.splitting)
    try:
        files = study_input_files(study)
        identity["files"] = {str(path): file_sha256(path) for path in sorted(files)}
    except OSError as error:
        raise UsageError(f"{error.filename}: cannot be read: {error.strerror}") from error
    text = json.dumps(json_safe(identity), sort_keys=True)
    return study_json_text_with_hash(study, hashlib.sha256(text.encode()).hexdigest())


def study_input_files(study: Study) -> set[Path]:
    """Return the files that a study's values name, whose content determines its results too."""
    given: list[Any] = [study.sets, study.swaps, [(axis.sets, axis.swaps) for axis in study.axes]]
    given += [[draw.values for draw in study.draws], [vars(spec) for spec in study.metrics]]
    beside = study.path.parent, study.scene_path.parent
    return _files_named_in_value([study.base.data, given], beside)


def record_of(study: Study) -> StudyRecord:
    """Return the `StudyRecord` that the study's folder will hold."""
    return StudyRecord.model_validate_json(study_json_text(study))


def _files_named_in_value(value: Any, beside: Sequence[Path]) -> set[Path]:
    """Return the files that the texts in a value name: encounters, terrain, tables, modules.

    Their content fixes results as much as the values do. A relative name counts from the folder of
    the file that holds it; whichever way a file is named, its content is what counts.
    """
    if isinstance(value, Mapping):
        return _files_named_in_value(
            [item for key, item in value.items() if key not in _PROSE], beside
        )
    if isinstance(value, list | tuple):
        return set().union(*(_files_named_in_value(item, beside) for item in value))
    if not isinstance(value, str):
        return set()
    try:
        files = _module_file(value, beside) or _named_files(value)
        return set() if files is None else files | _files_used_by_toml_files(files)
    except (OSError, ValueError):  # a text that can be no path
        return set()


def _named_files(text: str) -> set[Path] | None:
    """Return the file that a text names, or all files of a named run folder; None for neither."""
    folder, path = getattr(text, "folder", None), resolve_home(text)
    if folder is None and not path.is_absolute():
        return None
    whole = Path(os.path.abspath(Path(folder or "") / path))
    if whole.is_file():
        return {whole}
    if (whole / RUN_JSON).is_file():
        return {entry for entry in whole.iterdir() if entry.is_file()}
    return None


def _module_file(text: str, beside: Sequence[Path]) -> set[Path] | None:
    """Return as a set the source file of a class named by module or file; None if none is named."""
    module, class_name = split_type_name(text)
    if not class_name.isidentifier():
        return None
    if is_python_file_path(module):
        return {absolute_file_path(text)} if absolute_file_path(text).is_file() else None
    if not all(part.isidentifier() for part in module.split(".")):
        return None
    own = [Path(text.folder)] if hasattr(text, "folder") else []
    file = Path(file_of_module(module, [*own, *beside]))
    return {file} if file.is_absolute() and file.is_file() else None


def _files_used_by_toml_files(files: set[Path]) -> set[Path]:
    """Return the files that the TOML files among `files` extend or name."""
    extended: set[Path] = set()
    for path in files:
        if path.suffix == ".toml":
            with contextlib.suppress(SceneError):  # its runs say what is wrong with it
                scene = read_scene_file(path)
                extended |= {Path(os.path.abspath(source)) for source in scene.sources.values()}
                extended |= _files_named_in_value(scene.data, ())
    return extended


def sampled_geometry_names(study: Study) -> list[str]:
    """Return the names of the quantities by which a study samples runs; none if all are flown."""
    scene = study.scene(0)
    return geometry_names([spec.build(scene) for spec in study.metrics]) if study.allocate else []


def result_columns_of_study(study: Study) -> list[Result]:
    """Return metrics' result columns, with the plot colour and marker of their block, if any."""
    scene = study.scene(0)
    results = [result for spec in study.metrics for result in spec.build(scene).results()]
    marks = plot_mark_by_name({name: block.cls for name, block in scene.blocks.items()})
    return [_add_colour_and_marker(result, scene, marks) for result in results]


def _add_colour_and_marker(result: Result, scene: Scene, marks: Mapping[str, Mark]) -> Result:
    """Return a result with the colour and marker of its block, if that block's class has them."""
    name = result.block or result.name.partition(".")[2]
    if name not in scene.blocks or getattr(scene.blocks[name].cls, "mark", None) is None:
        return result
    return replace(result, mark=(marks[name].colour, marks[name].marker))


def is_categorical_axis(axis: Axis, scene: Scene) -> bool:
    """Return whether an axis has names as values: types, flags or a parameter's named choices."""
    for key, _ in axis.sets[0] if axis.sets else ():
        parts = key.split(".")
        if len(parts) != 3 or parts[0] != "blocks" or parts[1] not in scene.blocks:
            return False
        known = scene.blocks[parts[1]].cls.Parameters.model_fields.get(parts[2])
        if known is None or not _is_choice_of_names(known.annotation):
            return False
    return bool(axis.swaps and axis.swaps[0]) or bool(axis.sets and axis.sets[0])


def _is_choice_of_names(annotation: Any) -> bool:
    if get_origin(annotation) is Literal or annotation is bool:
        return True
    parts = [part for part in get_args(annotation) if part is not type(None)]
    return bool(parts) and all(_is_choice_of_names(part) for part in parts)


def study_json_text_with_hash(study: Study, digest: str) -> str:
    """Return the content of ``study.json``, given the SHA-256 of all that fixes its results."""
    content = {
        "study": str(study.path.resolve()),
        "study_sha256": digest,
        "title": study.title,
        "scene": str(study.scene_path.resolve()),
        "seed": study.seed,
        "cells": len(study.cells),
        "replicas": study.replicas,
        "axes": [
            {
                "column": axis.column,
                "words": readable_key(study.base.data, axis.key).removeprefix("blocks."),
                "values": axis.labels,
                "over": axis.column in study.over,
                "numeric": axis.is_numeric,
                "category": is_categorical_axis(axis, study.scene(0)),
                "sets": [
                    [(key, format_set_value(value)) for key, value in one] for one in axis.sets
                ],
                "swaps": axis.swaps,
            }
            for axis in study.axes
        ],
        "draws": [
            {"key": draw.key, "column": draw_column(draw.key), "numeric": draw.is_numeric}
            for draw in study.draws
        ],
        "results": [
            vars(result) | {"ratio": None if result.ratio is None else vars(result.ratio)}
            for result in result_columns_of_study(study)
        ],
        "sets": [(key, format_set_value(value)) for key, value in study.sets],
        "swaps": study.swaps,
        "compare": study.baseline,
        "compare_weight": study.compare_weight,
        "geometry": sampled_geometry_names(study),
        "stop_when": None if study.stop_when is None else vars(study.stop_when),
        "confidence": study.confidence,
        "interval": study.interval,
        "figures": [
            {
                k: v if isinstance(v, int | float | list) else str(v)
                for k, v in figure.model_dump(exclude_unset=True, warnings=False).items()
            }
            for figure in study.figures
        ],
        "requirements": [vars(requirement) for requirement in study.requirements],
        "repeat": study.repeat,
        "version": __version__,
        "tables": study.tables,
    }
    return json.dumps(json_safe(content), indent=2, allow_nan=False) + "\n"


def explained_record_of_study(study: Study) -> Explained:
    """Return the record of package versions, scene and models behind a study's runs."""
    scenes: list[SceneRecord] = []
    text = ""
    for cell in cells_covering_values(study)[:_MOST_CELLS]:
        labels = study.labels(cell)
        where = ", ".join(f"{name} = {short_text(value)}" for name, value in labels.items())
        try:
            scene = replica_scene(study.scene(cell), study.replica(0, cell))
            record = scene_record(where, scene)
            text = text or to_toml(scene.resolved())
        except (SceneError, BlockFailure, ValueError):
            continue  # its rows say why
        scenes.append(_entries_not_in_first(record, scenes[0]) if scenes else record)
    scenes = [one for one in scenes if one.models or one.effects or one.spared]
    return Explained(versions=package_versions(), scene=text, scenes=scenes)


def _entries_not_in_first(result: SceneRecord, first: SceneRecord) -> SceneRecord:
    """Return a scene's record with only the models, effects and spared work the first lacks."""
    lists = ("models", "effects", "spared")
    new = {n: [one for one in getattr(result, n) if one not in getattr(first, n)] for n in lists}
    return result.model_copy(update=new)


def write_explained(study: Study, folder: StudyFolder) -> None:
    """Write ``explained.json`` into a study's folder, unless it is there."""
    if read_explained(folder) is None:
        content = explained_record_of_study(study).model_dump()
        text = json.dumps(content, indent=1, allow_nan=False) + "\n"
        folder.write_file(EXPLAINED, text.encode())
