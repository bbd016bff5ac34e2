"""What each model does to the answers of three shipped studies: the first part of the page.

Tables and sentences are those of ``dsa-des cost STUDY --answer RESULT``, word by word.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dsa_des.answers.report import HEADS, AnswerReport
from dsa_des.commands.cost import CostProgress
from dsa_des.commands.cost_answer import AnswerOfStudy
from dsa_des.scene.examples import find_input_file
from dsa_des.studies.study_file import read_study
from dsa_des.text.safe_text import shell_line


@dataclass(frozen=True)
class AskedStudy:
    """A study of the page, and what is asked of it."""

    heading: str
    study: str
    answers: tuple[str, ...]
    sets: tuple[str, ...] = ()
    listed: tuple[str, ...] = ()
    budgets: tuple[str, ...] = ()
    block: str | None = None

    def command(self) -> str:
        """Return the command that gives its tables."""
        words = ["dsa-des", "cost", self.study]
        for option, values in (("answer", self.answers), ("set", self.sets), ("vary", self.listed),
                               ("budget", self.budgets)):  # fmt: skip
            words += [word for value in values for word in (f"--{option}", value)]
        return shell_line([*words, *(("--block", self.block) if self.block else ())])


STUDIES = (
    AskedStudy(
        "Risk",
        "radar_and_camera_risk",
        ("nmac_risk_ratio", "well_clear_lost_risk_ratio"),
        ("replicas=2000",),
        ("blocks.camera.scan_rate_hz=0.5", "blocks.camera.enabled=false"),
        block="tracker",
    ),
    AskedStudy("Scan rate", "radar_scan_rate", ("declaration_range_m.radar",), budgets=("500m",)),
    AskedStudy(
        "Tracking",
        "consistency",
        ("track_position_error_m", "track_nees_mean", "track_completeness", "track_broken"),
        listed=("blocks.radar.scan_rate_hz=2",),
    ),
)


def reports(workers: int, studies: Sequence[AskedStudy] = STUDIES) -> list[AnswerReport]:
    """Run all studies with all their models."""
    made = []
    for asked in studies:
        study = read_study(find_input_file(asked.study, "study"), sets=asked.sets)
        answer = AnswerOfStudy(study, asked.answers, asked.block, asked.listed, asked.budgets)
        with tempfile.TemporaryDirectory() as folder:
            if answer.run(Path(folder), workers, CostProgress(silent=False)):
                raise KeyboardInterrupt
            made.append(answer.report())
    return made


def head(made: Sequence[AnswerReport], studies: Sequence[AskedStudy] = STUDIES) -> str:
    """Return the decision of every study, as the page begins."""
    lines = []
    for asked, report in zip(studies, made, strict=True):
        for name in report.verdicts:
            said = report.conclusion_sentences(name)
            decision = " ".join(said[1:3]).partition(" Front, cheapest first:")[0]
            lines.append(f"- **{asked.heading}**, `{name}`. {decision}")
    return "\n".join(lines)


def section(made: Sequence[AnswerReport], studies: Sequence[AskedStudy] = STUDIES) -> str:
    """Return the tables and sentences of all studies."""
    lines: list[str] = []
    for asked, report in zip(studies, made, strict=True):
        lines += [f"### {asked.heading}", "", f"`{asked.command()}`", "", *_tables(report)]
    return "\n".join(lines).rstrip()


def _tables(report: AnswerReport) -> list[str]:
    lines: list[str] = []
    for result in report.results:
        every = list(report.table_rows(result.name))
        rows = [row for row in every if row[-1] != "same"]
        used = [k for k in range(len(HEADS)) if any(row[k] for row in rows)]
        lines += [f"**{report.table_heading(result.name)}**", ""]
        lines.append(f"| {' | '.join(HEADS[k] for k in used)} |")
        lines.append("|---" * len(used) + "|")
        lines += [f"| {' | '.join(row[k] for k in used)} |" for row in rows]
        same = [
            f"{row[0]} ({row[1]}{'' if row[3] == '0 to 0' else f', {row[3]}'})"
            for row in every
            if row[-1] == "same"
        ]
        said = beside_the_table(report.conclusion_sentences(result.name), same)
        lines += ["", *(f"{line}\n" for line in said)]
    return [*lines, *(f"{line}  " for line in report.notes_on_tables()), ""]


#: Sentences that list what the head of the page, or the column of verdicts, shows.
_SHOWN = (
    "May be taken",
    "No model is surely",
    "The cheapest is",
    "None of them surely",
    "Within it:",
    "Surely changed",
)


def beside_the_table(sentences: Sequence[str], same: Sequence[str]) -> list[str]:
    """Return what the sentences about a result say that the page does not show elsewhere.

    Models with which no run differs are no rows of the table: `same` names them, with their CPU
    and the interval of the change where it is no point.
    """
    rest = [line for line in sentences if not line.startswith(_SHOWN)]
    return [
        f"{line.partition('):')[0]}): {'; '.join(same)}."
        if line.startswith("The same in every run")
        else line
        for line in rest
    ]
