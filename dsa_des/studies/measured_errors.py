"""Measured errors of the models that a study uses, kept beside its results: ``errors.json``."""

import json
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, ValidationError

from dsa_des.costs.scene_errors import scene_errors
from dsa_des.costs.variants import Variants
from dsa_des.studies.folder import StudyFolder
from dsa_des.studies.record import StrictRecord
from dsa_des.studies.safe_files import read_regular
from dsa_des.studies.stored_rows import StoredRows

ERRORS = "errors.json"
_MOST_BYTES = 4 * 2**20


class ErrorRecord(StrictRecord):
    """How far the model of a block is off in one quantity, over target-scans; NaN where unknown."""

    model_config = ConfigDict(allow_inf_nan=True)

    block: str
    ladder: str
    rung: str
    quantity: str
    unit: str
    mean: float
    p95: float
    largest: float
    target_scans: int
    against: str


class MeasuredErrors(StrictRecord):
    """Errors of the models of one run, and of what nothing could be measured."""

    command: str
    rows: list[ErrorRecord]
    notes: list[str]


def measure_errors(folder: StudyFolder) -> None:
    """Run the first run's scene with its models and their references, and keep the errors.

    It reads the scene that the folder names, and imports its blocks: not for folders of strangers.

    Raises
    ------
    SceneError
        If the scene cannot be run.
    OSError
        If the folder cannot be written.
    """
    record = folder.record
    first = StoredRows(folder).first
    swaps, sets = record.changes(first)
    variants = Variants(
        Path(record.scene), sets=[f"{key}={value}" for key, value in sets],
        swaps=[f"{block}={name}" for block, name in swaps], seed=int(first["seed"]),
    )  # fmt: skip
    rows, notes = scene_errors(variants)
    content: dict[str, Any] = {"command": record.command(first), "rows": rows, "notes": notes}
    folder.write_file(ERRORS, (json.dumps(content, indent=1) + "\n").encode())


def read_errors(folder: StudyFolder) -> MeasuredErrors | None:
    """Return the errors that a folder holds; None where it holds none that can be used."""
    try:
        content = read_regular(folder.path / ERRORS, _MOST_BYTES)
        return MeasuredErrors.model_validate_json(content)
    except (OSError, ValidationError):
        return None
