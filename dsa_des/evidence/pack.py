"""The pack of a case: one folder with requirements, results, and all that repeats them."""

from collections.abc import Mapping
from typing import Any

from dsa_des.evidence.case import AS_STATED, ASSESSED, SENSITIVITY, EvidenceCase
from dsa_des.evidence.findings import (
    MET,
    NOT_KNOWN,
    Convergence,
    Finding,
    ParameterChange,
    findings_of,
    parameter_changes_of,
    result_line_as_dict,
    verdict_line,
)
from dsa_des.evidence.inputs import (
    CaseFiles,
    digest_of_results,
    files_of_case,
    models_of_blocks,
    parameter_and_wire_records,
)
from dsa_des.results.folder import StudyFolder
from dsa_des.results.models import package_versions, read_explained
from dsa_des.results.tables import Tables
from dsa_des.text.plain_json import json_text
from dsa_des.text.safe_text import shell_line

#: The parts of a pack: what is read by people, and by programs; inputs; the studies' own folders.
PAGE, MACHINE, INPUTS, STUDIES = "evidence.html", "evidence.json", "inputs", "studies"


class Pack:
    """What a case shows, once its studies have run."""

    def __init__(
        self, case: EvidenceCase, folders: Mapping[str, StudyFolder], tables: Mapping[str, Tables],
        sets: tuple[str, ...] = (), replicas: int | None = None,
    ) -> None:  # fmt: skip
        self.case, self.folders, self.tables = case, folders, tables
        self.files: CaseFiles = files_of_case(case)
        self.findings: list[Finding] = findings_of(case, tables)
        self.changes: list[ParameterChange] = parameter_changes_of(case, tables)
        self.line = verdict_line(self.findings)
        words = ["dsa-des", "evidence", f"{INPUTS}/{self.files.case}"]
        words += [word for one in sets for word in ("--set", one)]
        words += ["--encounters", str(replicas)] if replicas else []
        self.command = shell_line([*words, "--out", "AGAIN"])

    @property
    def passes(self) -> bool | None:
        """Whether all requirements are met; None where no verdict can be given."""
        verdicts = {one.verdict for one in self.findings}
        return None if NOT_KNOWN in verdicts else verdicts == {MET}

    def evidence(self) -> dict[str, Any]:
        """Return all evidence as a dict of plain values, without paths or times: repeatable."""
        tables = self.case.tables
        return {
            "verdict": {"line": self.line, "passes": self.passes},
            "case": {"title": tables.title, "description": tables.description},
            "system": tables.system.model_dump(),
            "requirements": [self._requirement_as_dict(one) for one in self.findings],
            "also": [result_line_as_dict(line) for name in tables.also
            for line in self._result_lines(name)],
            "beside": [self._compared_study_as_dict(one.name, one.about) for one in tables.beside],
            "sample": self._sample_as_dict(),
            "convergence": {
                "rule": tables.convergence.text(),
                "estimates": [_convergence_as_dict(one) for one in self.findings],
            },
            "sensitivity": [_change_as_dict(one) for one in self.changes],
            "sensitivity_encounters": self._replica_count(SENSITIVITY),
            "parameters": parameter_and_wire_records(self.case, self.files),
            "models": models_of_blocks(self.case.system_study),
            "left_out": self._omissions_as_dict(),
            "seeds": {name: study.seed for name, study in self.case.studies.items()},
            "inputs": self.files.file_names_and_sha256(),
            "results": [
                {"study": name, "runs": len(self.tables[name].rows.places),
                 "failed": self.tables[name].rows.failed, "rows_sha256": digest_of_results(folder)}
                for name, folder in self.folders.items()
            ],
            "versions": package_versions(),
            "command": self.command,
        }  # fmt: skip

    def evidence_json(self) -> bytes:
        """Return the content of ``evidence.json``."""
        text = json_text(self.evidence(), digits=12, indent=1, ensure_ascii=False)
        return f"{text}\n".encode()

    def _result_lines(self, name: str, study: str = ASSESSED) -> list[Any]:
        return [line for line in self.tables[study].lines if line.result.name == name]

    def _replica_count(self, study: str) -> int:
        return self.case.studies[study].replicas if study in self.case.studies else 0

    def _requirement_as_dict(self, one: Finding) -> dict[str, Any]:
        asked = one.requirement
        numbers = result_line_as_dict(one.line)
        return {
            "name": asked.name, "text": asked.text, "source": asked.source,
            "limit": asked.limit, "sense": "most" if asked.most is not None else "least",
            "unit": asked.unit, "study": asked.study, **numbers,
            "confidence": self.tables[asked.study].record.confidence,
            "moved": one.convergence.moved, "may_move": one.convergence.allowed,
            "converged": one.convergence.is_converged, "verdict": one.verdict,
        }  # fmt: skip

    def _compared_study_as_dict(self, name: str, about: str) -> dict[str, Any]:
        wanted = [one.result for one in self.case.tables.requirements if one.study == ASSESSED]
        wanted += self.case.tables.also
        numbers = [
            result_line_as_dict(line) for one in wanted for line in self._result_lines(one, name)
        ]
        return {
            "name": name,
            "about": about,
            "encounters": self._replica_count(name),
            "results": numbers,
        }

    def _sample_as_dict(self) -> dict[str, Any]:
        ratios = [one.line.ratio for one in self.findings if one.line.ratio is not None]
        size = ratios[0].effective_sample_size if ratios else None
        return {
            **self.case.tables.sample.model_dump(),
            "encounters": self._replica_count(ASSESSED), "effective_sample_size": size,
            "drawn": [draw.key for draw in self.tables[ASSESSED].record.draws],
        }  # fmt: skip

    def _omissions_as_dict(self) -> dict[str, Any]:
        explained = read_explained(self.folders[ASSESSED])
        scene = explained.scenes[0] if explained and explained.scenes else None
        return {
            "stated": [one.model_dump() for one in self.case.tables.left_out],
            "effects": [
                {"block": e.block, "effect": e.effect, "because": e.because}
                for e in (scene.effects if scene else ()) if not e.simulated
            ],
        }  # fmt: skip


def _convergence_as_dict(one: Finding) -> dict[str, Any]:
    c: Convergence = one.convergence
    return {
        "requirement": one.requirement.name, "rule_counts_from": c.last_from,
        "moved": c.moved, "may_move": c.allowed,
        "encounters": c.counts, "value": [e.value for e in c.estimates],
        "low": [e.low for e in c.estimates], "high": [e.high for e in c.estimates],
    }  # fmt: skip


def _change_as_dict(one: ParameterChange) -> dict[str, Any]:
    d = one.difference
    return {
        "key": one.key, "unit": one.unit, AS_STATED.replace(" ", "_"): one.stated,
        "value": one.value, "result": one.result, "difference": d.value, "low": d.low,
        "high": d.high, "in_limits": one.in_limits,
    }  # fmt: skip
