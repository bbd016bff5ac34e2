"""What a study's folder says of the models of its runs: ``explained.json``, ``errors.json``.

Which model each block uses and how large its error is, which effects are simulated and which are
left out and why, and with what versions the runs were made.
"""

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import TypeVar

from pydantic import ConfigDict, ValidationError

from dsa_des.files.sealed_files import read_regular_file
from dsa_des.record.version import __version__
from dsa_des.results.folder import StudyFolder
from dsa_des.results.record import StrictRecord

EXPLAINED, ERRORS = "explained.json", "errors.json"
_PACKAGES = ("numpy", "scipy", "pyarrow", "simpy", "networkx", "pydantic", "numba")
_MOST_BYTES = 16 * 2**20
_Record = TypeVar("_Record", bound=StrictRecord)


class ModelRecord(StrictRecord):
    """A block in a report: name, type, what it models, the rung chosen of each accuracy ladder."""

    block: str
    type: str
    about: str
    #: ``earth: ellipsoid, exact on WGS 84 (the reference)``.
    rungs: list[str]


class EffectRecord(StrictRecord):
    """One effect of a block, whether it is simulated or left out, and why."""

    block: str
    effect: str
    simulated: bool
    because: str
    #: Largest influence that is proven, by quantity.
    bound: dict[str, float] = {}


class SceneRecord(StrictRecord):
    """Models, effects and spared work of a cell's scene; after the first cell only what differs."""

    where: str
    models: list[ModelRecord]
    effects: list[EffectRecord]
    #: What work blocks spare themselves, and why results allow it.
    spared: list[tuple[str, str]]


class Explained(StrictRecord):
    """Package versions, resolved scene and models of a study's runs, as in ``explained.json``."""

    versions: dict[str, str]
    #: The first run's scene with every default written out, as TOML.
    scene: str
    scenes: list[SceneRecord]


def package_versions() -> dict[str, str]:
    """Return the versions of this program, of Python and of the packages it computes with."""
    result = {"dsa_des": __version__, "Python": platform.python_version()}
    for name in _PACKAGES:
        try:
            result[name] = version(name)
        except PackageNotFoundError:
            continue
    return result


class ErrorRecord(StrictRecord):
    """Mean, 95th percentile, largest error of a model in one quantity over target-scans, or NaN."""

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
    """Measured errors of the models of one run, and notes on what could not be measured."""

    command: str
    rows: list[ErrorRecord]
    notes: list[str]


def read_explained(folder: StudyFolder) -> Explained | None:
    """Return the record of models and versions in the study's folder; None if none can be read."""
    return _read_record_if_valid(folder, EXPLAINED, Explained)


def read_model_errors(folder: StudyFolder) -> MeasuredErrors | None:
    """Return the measured model errors in the study's folder; None where none can be read."""
    return _read_record_if_valid(folder, ERRORS, MeasuredErrors)


def _read_record_if_valid(folder: StudyFolder, name: str, model: type[_Record]) -> _Record | None:
    try:
        return model.model_validate_json(read_regular_file(folder.path / name, _MOST_BYTES))
    except (OSError, ValidationError):
        return None
