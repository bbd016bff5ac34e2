"""The digest of all that fixes a study's results, and the ``study.json`` that holds it."""

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dsa_des.block.source_file import file_of, is_file, path_of, split_name
from dsa_des.errors import SceneError, UsageError
from dsa_des.files.input_files import resolve_home
from dsa_des.files.output_folder import RUN_JSON
from dsa_des.record.version import __version__
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies.record import StudyRecord, record_text
from dsa_des.studies.sample import file_digest
from dsa_des.studies.study import Study
from dsa_des.studies.study_tables import json_safe

#: Texts for people, which name no file.
_SAID = ("title", "description", "labels")


def description_text(study: Study) -> str:
    """Return the content of ``study.json``: what fixes every result, and how to read them."""
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
    given: list[Any] = [study.sets, study.swaps, [(axis.sets, axis.swaps) for axis in study.axes]]
    given += [[draw.values for draw in study.draws], [vars(spec) for spec in study.metrics]]
    beside = study.path.parent, study.scene_path.parent
    try:
        files = _files_in([study.base.data, given], beside)
        identity["files"] = {str(path): file_digest(path) for path in sorted(files)}
    except OSError as error:
        raise UsageError(f"{error.filename}: cannot be read: {error.strerror}") from error
    text = json.dumps(json_safe(identity), sort_keys=True)
    return record_text(study, hashlib.sha256(text.encode()).hexdigest())


def description(study: Study) -> dict[str, Any]:
    """Return the content of ``study.json`` as a table."""
    content: dict[str, Any] = json.loads(description_text(study))
    return content


def record_of(study: Study) -> StudyRecord:
    """Return the record of a study as its folder will hold it."""
    return StudyRecord.model_validate_json(description_text(study))


def _files_in(value: Any, beside: Sequence[Path]) -> set[Path]:
    """Return the files that values name: encounters, terrain, tables, modules.

    Their content fixes results as much as the values do. A relative name counts from the folder of
    the file that holds it; whichever way a file is named, its content is what counts.

    Parameters
    ----------
    value : object
        Tables, lists and texts.
    beside : sequence of Path
        Folders in which modules are looked for.
    """
    if isinstance(value, Mapping):
        return _files_in([item for key, item in value.items() if key not in _SAID], beside)
    if isinstance(value, list | tuple):
        return set().union(*(_files_in(item, beside) for item in value))
    if not isinstance(value, str):
        return set()
    try:
        found = _module_of(value, beside) or _named(value)
        return set() if found is None else found | _extended_by(found)
    except (OSError, ValueError):  # a text that can be no path
        return set()


def _named(text: str) -> set[Path] | None:
    """Return the file of this name, or those of a run's folder."""
    folder, path = getattr(text, "folder", None), resolve_home(text)
    if folder is None and not path.is_absolute():
        return None
    whole = Path(os.path.abspath(Path(folder or "") / path))
    if whole.is_file():
        return {whole}
    if (whole / RUN_JSON).is_file():
        return {entry for entry in whole.iterdir() if entry.is_file()}
    return None


def _module_of(text: str, beside: Sequence[Path]) -> set[Path] | None:
    """Return the file of a class that is named by its module or file."""
    module, class_name = split_name(text)
    if not class_name.isidentifier():
        return None
    if is_file(module):
        return {path_of(text)} if path_of(text).is_file() else None
    if not all(part.isidentifier() for part in module.split(".")):
        return None
    own = [Path(text.folder)] if hasattr(text, "folder") else []
    file = Path(file_of(module, [*own, *beside]))
    return {file} if file.is_absolute() and file.is_file() else None


def _extended_by(files: set[Path]) -> set[Path]:
    """Return what TOML files among some extend and name themselves."""
    found: set[Path] = set()
    for path in files:
        if path.suffix == ".toml":
            with contextlib.suppress(SceneError):  # its runs say what is wrong with it
                scene = read_scene_file(path)
                found |= {Path(os.path.abspath(source)) for source in scene.sources.values()}
                found |= _files_in(scene.data, ())
    return found
