"""The file of a case: what is asked of which system, and the studies that answer it.

Everything is checked before anything runs: a limit without a unit, a result that no study gives, a
parameter whose source nobody states, are errors of the file.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError, model_validator

from dsa_des.block.component import Parameters, ScenePath
from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.results.record import Result
from dsa_des.scene.keys import flatten_tables, parse_key_path
from dsa_des.scene.overrides import apply_sets
from dsa_des.scene.parameter_errors import explain_validation_error
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import SceneFile, read_scene_file
from dsa_des.studies.study import Study, format_set_value
from dsa_des.studies.study_digest import result_columns_of_study
from dsa_des.studies.study_file import read_study
from dsa_des.text.run_commands import format_set_option_value

#: The name of the study of the system itself, and of the one that changes a parameter at a time.
ASSESSED, SENSITIVITY = "assessed", "sensitivity"
#: What the wires of a scene are called among the sources.
WIRES = "wires"
#: The axis of that study, and its value where nothing is changed.
CHANGED, AS_STATED = "changed", "as stated"


def _check_printable(text: str) -> str:
    if not text.strip():
        raise ValueError("must not be empty")
    return text


_Text = Annotated[str, AfterValidator(_check_printable)]


class AssessedSystem(Parameters):
    """What is assessed."""

    name: _Text
    version: _Text
    description: str = ""


class CaseRequirement(Parameters):
    """A required limit on a result of a study."""

    name: _Text
    text: _Text = Field(description="What is asked for, in words.")
    source: _Text = Field(description="Who asks for it.")
    result: _Text
    study: str = ASSESSED
    unit: _Text = Field(description="Of the limit.")
    most: float | None = None
    least: float | None = None

    @model_validator(mode="after")
    def _check_one_limit(self) -> Any:
        if (self.most is None) == (self.least is None):
            raise ValueError("a requirement has one limit: most = NUMBER or least = NUMBER")
        return self

    @property
    def limit(self) -> float:
        """The number that the result is compared with."""
        return self.most if self.most is not None else self.least  # type: ignore[return-value]

    def is_met(self, low: float, high: float) -> bool:
        """Return whether an interval (or a value, given twice) lies within the limit."""
        return high <= self.limit if self.most is not None else low >= self.limit

    def describe_limit(self) -> str:
        """Return the limit as text with its unit, such as ``at most 0.3``."""
        return f"at {'most' if self.most is not None else 'least'} {self.limit:g} {self.unit}"


class ConvergenceRule(Parameters):
    """When an estimate counts as known: how little it may still have moved."""

    share: float = Field(default=0.05, gt=0, le=1)
    of: Literal["estimate", "limit"] = Field(
        default="estimate", description="Of what it is a share: of the estimate or of the limit."
    )
    over_last: float = Field(
        default=0.5, gt=0, lt=1, description="Share of the units over which it may not move more."
    )

    def text(self) -> str:
        """Return the rule as a sentence."""
        return (
            f"over the last {100 * self.over_last:g} % of the encounters the running estimate stays"
            f" within {100 * self.share:g} % of the {self.of} of where it ends"
        )


class BesideStudy(Parameters):
    """Another study of the same encounters, which is shown beside the system's."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,40}$")
    study: ScenePath
    about: _Text
    replicas: int | None = Field(default=None, ge=1)
    of_system: bool = Field(
        default=False, description="It is of the system too: changes of its scene are made here."
    )


class SampleSource(Parameters):
    """What the encounters are drawn from."""

    model: _Text
    licence: _Text
    weights: _Text = Field(description="What the weight of an encounter undoes.")


class SensitivityKey(Parameters):
    """A parameter of the system's scene that is changed alone."""

    key: _Text
    unit: _Text
    values: tuple[Any, ...] = Field(min_length=1, max_length=9)


class LeftOutItem(Parameters):
    """Something that the case leaves out, and why it may be left out."""

    what: _Text
    why: _Text


class CaseTables(Parameters):
    """A case as its file states it."""

    title: _Text
    description: str = ""
    study: ScenePath = Field(description="Of the system: one cell, whose replicas are encounters.")
    set: dict[str, Any] = Field(default={}, description="Changes of the system's scene.")
    system: AssessedSystem
    requirements: tuple[CaseRequirement, ...] = Field(min_length=1)
    sample: SampleSource
    sources: dict[str, Any] = Field(description="Block or dotted key → where its values are from.")
    also: tuple[str, ...] = Field(default=(), description="Further results that are shown.")
    beside: tuple[BesideStudy, ...] = ()
    convergence: ConvergenceRule = ConvergenceRule()
    sensitivity: tuple[SensitivityKey, ...] = ()
    sensitivity_replicas: int = Field(default=300, ge=2)
    left_out: tuple[LeftOutItem, ...] = Field(min_length=1)


@dataclass(frozen=True)
class EvidenceCase:
    """A checked case."""

    #: Its tables as read.
    file: SceneFile
    tables: CaseTables
    #: By name, in the order in which they run.
    studies: Mapping[str, Study]
    #: What each study gives, by its name and the result's.
    results: Mapping[str, Mapping[str, Result]]
    #: For each value of the axis after the first: key, value, label.
    sensitivity: tuple[tuple[SensitivityKey, Any, str], ...] = ()

    @property
    def system_study(self) -> Study:
        """The study of the system itself."""
        return self.studies[ASSESSED]


def read_case(path: Path, sets: Iterable[str] = (), replicas: int | None = None) -> EvidenceCase:
    """Read and check a case with all its studies.

    `replicas` takes the place of those that the system's study states, and of those beside it
    where the case states none.
    """
    file = read_scene_file(path)
    apply_sets(file, sets)
    file.raise_if_problems()
    for key, takes_it in (("blocks", "run"), ("axes", "study")):
        if key in file.data and "requirements" not in file.data:
            raise SceneError(
                [Problem(str(file.path), "", f"is no case: dsa-des {takes_it} takes it")]
            )
    try:
        tables = CaseTables.model_validate(file.data)
    except ValidationError as error:
        raise SceneError(explain_validation_error(file, (), "a case", CaseTables, error)) from None
    asked = [one.name for one in tables.requirements]
    for index, name in enumerate(asked):
        if name in asked[:index]:
            raise SceneError(
                [file.problem(("requirements", index, "name"), "is given twice", name)]
            )
    studies = {ASSESSED: _load_system_study(file, tables, replicas)}
    for index, one in enumerate(tables.beside):
        if one.name in {*studies, SENSITIVITY}:
            raise SceneError([file.problem(("beside", index, "name"), "is given twice", one.name)])
        many = one.replicas or replicas
        changed = [f"replicas={many}"] if many else []
        changed += _study_set_texts(tables) if one.of_system else []
        studies[one.name] = read_study(one.study, sets=changed)
    varied: tuple[tuple[SensitivityKey, Any, str], ...] = ()
    if tables.sensitivity:
        varied, studies[SENSITIVITY] = _single_changes_and_study(file, tables, studies[ASSESSED])
    results = {
        name: {r.name: r for r in result_columns_of_study(study)} for name, study in studies.items()
    }
    case = EvidenceCase(file, tables, studies, results, varied)
    _check_results(case)
    _check_sources(case)
    file.raise_if_problems()
    return case


def _study_set_texts(tables: CaseTables) -> list[str]:
    return [
        f"set.{key}={format_set_value(value)}" for key, value in flatten_tables(tables.set).items()
    ]


def _load_system_study(file: SceneFile, tables: CaseTables, replicas: int | None) -> Study:
    sets = [f"replicas={replicas}"] if replicas else []
    study = read_study(tables.study, sets=[*sets, *_study_set_texts(tables)])
    if len(study.cells) != 1:
        message = f"has {len(study.cells)} cells; a case is one: a study without axes"
        raise SceneError([file.problem(("study",), message, str(file.data["study"]))])
    return study


def _single_changes_and_study(
    file: SceneFile, tables: CaseTables, assessed: Study
) -> tuple[tuple[tuple[SensitivityKey, Any, str], ...], Study]:
    """Return (parameter, value, label) of all single changes, and a study with these as axis."""
    scene = assessed.scene(0).resolved()
    stated: dict[str, Any] = {}
    for index, one in enumerate(tables.sensitivity):
        result: Any = scene
        for part in parse_key_path(scene, one.key):
            inside = isinstance(result, dict) and part in result
            if not inside and not (isinstance(result, list) and isinstance(part, int)):
                known = list(result) if isinstance(result, dict) else []
                message = f"the scene has no such value{did_you_mean(str(part), known)}"
                at = ("sensitivity", index, "key")
                raise SceneError([file.problem(at, message, one.key)])
            result = result[part]
        stated[one.key] = result
    varied = tuple(
        (one, value, f"{one.key} = {format_case_value(value)}")
        for one in tables.sensitivity for value in one.values
    )  # fmt: skip
    columns = {
        key: [value, *(v if one.key == key else value for one, v, _ in varied)]
        for key, value in stated.items()
    }
    axis = {"values": [AS_STATED, *(label for _, _, label in varied)], "set": columns}
    keys = {
        "axes": {CHANGED: axis},
        "compare": {"axis": CHANGED, "baseline": AS_STATED},
        "replicas": min(tables.sensitivity_replicas, assessed.replicas),
        "figures": [], "requirements": [],
    }  # fmt: skip
    return varied, read_study(tables.study, sets=_study_set_texts(tables), keys=keys)


def format_case_value(value: Any) -> str:
    """Return a value as text in the form in which a scene file writes it."""
    return (
        format_set_value(value)
        if isinstance(value, list | dict)
        else format_set_option_value(value)
    )


def _check_results(case: EvidenceCase) -> None:
    """Note as problems of the case: results its studies lack, and limits no value can reach."""
    named = [
        (("requirements", index), one.study, one.result)
        for index, one in enumerate(case.tables.requirements)
    ]
    named += [(("also", index), ASSESSED, name) for index, name in enumerate(case.tables.also)]
    for at, study, name in named:
        inside = at[0] == "requirements"
        if study not in case.studies or study == SENSITIVITY:
            known = [name for name in case.studies if name != SENSITIVITY]
            message = f"the case has no such study{did_you_mean(study, known)}"
            case.file.report((*at, "study"), message, study)
            continue
        known = [r.name for r in case.results[study].values() if r.is_summarised]
        if name not in known:
            message = f"the study gives no such result{did_you_mean(name, known)}"
            case.file.report((*at, "result") if inside else at, message, name)
        elif inside and len(case.studies[study].cells) != 1:
            message = f"has {len(case.studies[study].cells)} cells; a requirement is held to one"
            case.file.report((*at, "study"), message, study)
        elif inside:
            _check_limit(case, at, study, name)


def _check_limit(case: EvidenceCase, at: tuple[str, int], study: str, result: str) -> None:
    """Note a problem of the case if a requirement's limit is no possible value of its result."""
    asked = case.tables.requirements[at[1]]
    low, high = case.results[study][result].bounds
    if low <= asked.limit <= high:
        return
    allowed = f"{low:g} or more" if math.isinf(high) else f"between {low:g} and {high:g}"
    sense = "most" if asked.most is not None else "least"
    message = f"no value of {result} lies there; allowed: {allowed}"
    case.file.report((*at, sense), message, asked.limit)


def _check_sources(case: EvidenceCase) -> None:
    """Note a problem for every block with values in the scene whose source is not stated."""
    sources, scene = case.tables.sources, case.system_study.scene(0)
    for key in flatten_tables(sources):
        parts = key.removeprefix("blocks.").split(".")
        if parts[0] not in {*scene.blocks, WIRES}:
            hint = did_you_mean(parts[0], [*scene.blocks, WIRES])
            message = f"the scene has no block {parts[0]!r}{hint}"
            case.file.report(("sources", key), message)
    for name, block in scene.blocks.items():
        stated = block.parameters.model_fields_set
        missing = [
            key for key in sorted(stated) if stated_source_of_parameter(sources, name, key) is None
        ]
        if missing:
            message = (
                f"is missing: nobody says where {', '.join(missing)} of block {name!r} come from"
            )
            case.file.report(("sources", name), message)
    if wires_with_options(scene) and stated_source_of_parameter(sources, WIRES, "") is None:
        message = "is missing: nobody says where delays and losses of wires come from"
        case.file.report(("sources", WIRES), message)


def wires_with_options(scene: Scene) -> list[dict[str, Any]]:
    """Return the wires of a scene that have options such as delay or loss, as dicts."""
    whole = [wire for wire in scene.resolved()["wires"] if isinstance(wire, dict)]
    return [dict(wire) for wire in whole if set(wire) - {"from", "to", "holds"}]


def stated_source_of_parameter(sources: Mapping[str, Any], block: str, key: str) -> str | None:
    """Return a parameter's stated source: its key's, else its block's; None if there is neither."""
    known = {
        name.removeprefix("blocks."): str(text) for name, text in flatten_tables(sources).items()
    }
    return known.get(f"{block}.{key}", known.get(block))
