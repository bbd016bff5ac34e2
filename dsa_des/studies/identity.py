"""The digest of all that fixes a study's results, and the ``study.json`` that holds it."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dsa_des.errors import UsageError
from dsa_des.record.version import __version__
from dsa_des.studies.record import StudyRecord, record_text
from dsa_des.studies.sample import file_digest
from dsa_des.studies.study import Study
from dsa_des.studies.study_tables import json_safe


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
    files = _files_in([study.base.data, study.sets, [axis.sets for axis in study.axes]])
    try:
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


def _files_in(value: Any) -> set[Path]:
    """Return the files that values name: encounters, terrain, tables.

    Their content fixes results as much as the values do.
    """
    if isinstance(value, Mapping):
        return _files_in(list(value.values()))
    if isinstance(value, list | tuple):
        return set().union(*map(_files_in, value))
    if not isinstance(value, str):
        return set()
    try:
        path = getattr(value, "folder", Path()) / Path(value)
        return {path.resolve()} if path.is_absolute() and path.is_file() else set()
    except (OSError, ValueError):  # a text that can be no path
        return set()
