"""``dsa-des cost STUDY --answer RESULT``: what each model costs, and does to a study's result."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dsa_des.answers.alternatives import (
    Alternatives,
    add_model_axis,
    find_models_to_compare,
    same_replicas_study_and_notes,
)
from dsa_des.answers.changes import changes_by_model
from dsa_des.answers.figure import draw_changes_against_cpu
from dsa_des.answers.models_in_turns import (
    Batch,
    TurnTimes,
    run_all_models_in_turns,
    split_into_batches,
)
from dsa_des.answers.report import AnswerReport, print_report
from dsa_des.answers.verdicts import BEYOND, NOTHING, OPEN, Limit, parse_limits
from dsa_des.commands.cost import CostProgress
from dsa_des.commands.study import (
    check_workers,
    choose_output_folder,
    exit_with_resume_hint,
    options_as_sets,
    require_empty_or_resumed,
    summarised_result_names,
)
from dsa_des.costs.cost_report import write_rows_as_parquet
from dsa_des.errors import UsageError
from dsa_des.files.output_file import write_file
from dsa_des.record.run_folder import write_run_json
from dsa_des.results.folder import NotWritten, StudyFolder
from dsa_des.results.record import Result
from dsa_des.results.rows import Rows, StoredRows
from dsa_des.scene.examples import find_input_file
from dsa_des.studies.executors import make_executor, usable_processor_count
from dsa_des.studies.study import Study, portable_command_line
from dsa_des.studies.study_digest import result_columns_of_study, study_json_text
from dsa_des.studies.study_file import read_study
from dsa_des.terminal.terminal import say, say_json
from dsa_des.text.safe_text import shell_line

#: Where a study's folder of all runs stands in that of the command, and what the turns took.
_RUNS, _TURNS = "study", "turns.json"


def run_study_with_each_model(
    scene: str | None,
    answers: tuple[str, ...],
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
    block: str | None,
    listed: tuple[str, ...],
    repeats: int | None,
    budgets: tuple[str, ...],
    workers: int | None,
    out: str | None,
    as_json: bool,
    against: str | None,
    whole_chain: bool,
    map_name: str | None,
    resume: bool,
    no_figures: bool,
) -> None:
    """Run a study with each model in turn, write the tables and print the verdicts.

    After ctrl-C what is finished is told and kept, to be resumed; exit code 130.
    """
    for option, given in (("--against", against), ("--all", whole_chain), ("--map", map_name)):
        if given:
            raise UsageError(f"{option}: does not go with --answer, where each model stands alone "
                             "for the scene's own")  # fmt: skip
    if scene is None:
        raise UsageError(f"--answer {answers[0]}: give a STUDY (dsa-des examples lists those that "
                         "are shipped)")  # fmt: skip
    check_workers(workers)
    path = find_input_file(scene, "study")
    sets = (*sets, *options_as_sets(swaps, seed, None))
    sets = sets if duration is None else (*sets, f"set.duration_s={duration}")
    described = read_study(path, sets=sets)
    words = (
        _as_command_words("answer", answers)
        + _as_command_words("vary", listed)
        + _as_command_words("budget", budgets)
    )
    words += _as_command_words("block", [block] if block else [])
    words += _as_command_words("repeats", [str(repeats)] if repeats else [])
    described.repeat = portable_command_line(["cost", *words], sets, described.path)
    answer = AnswerOfStudy(described, answers, block, listed, budgets, repeats)
    target = choose_output_folder(Path("runs"), f"{path.stem}-cost", out, resume)
    require_empty_or_resumed(target, resume, "what was begun there")
    folder = target if isinstance(target, Path) else target()
    words += [
        *_as_command_words("workers", [str(workers)] if workers else []),
        "--out",
        str(folder),
    ]
    words += ["--no-figures"] * no_figures + ["--json"] * as_json + _as_command_words("set", sets)
    again = shell_line(["dsa-des", "cost", "--resume", *words, "--", scene])
    progress = CostProgress(silent=as_json)
    stopped = answer.run(folder, workers or usable_processor_count(), progress, resume)
    if stopped and not answer.has_model_runs():
        exit_with_resume_hint("interrupted in the first turn", again, 130)
    report = answer.report()
    rows = report.rows()
    said = {name: report.conclusion_sentences(name) for name in report.verdicts}
    content: dict[str, Any] = {"rows": rows, "sentences": said, "notes": report.notes_on_tables()}
    try:
        write_rows_as_parquet(folder / "answer.parquet", rows)
        write_file(folder / "answer.csv", _rows_to_csv(rows))
        if not no_figures:
            draw_changes_against_cpu(folder / "answer.png", report)
        write_run_json(folder, {"title": described.title, "cost": content})
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror or error}") from error
    if as_json:
        say_json(rows)
    else:
        print_report(report)
        say()
        say(f"{folder}: {', '.join(sorted(one.name for one in folder.iterdir()))}")
    if stopped:
        exit_with_resume_hint(f"interrupted after {answer.finished_turns_text()}", again, 130)


def _as_command_words(option: str, values: Sequence[str]) -> list[str]:
    return [word for value in values for word in (f"--{option}", value)]


class AnswerOfStudy:
    """A study whose answers are asked for with each of many models."""

    def __init__(
        self,
        study: Study,
        answers: Sequence[str],
        block: str | None = None,
        listed: Sequence[str] = (),
        budgets: Sequence[str] = (),
        repeats: int | None = None,
    ) -> None:
        results = result_columns_of_study(study)
        summarised_result_names(results, answers, "--answer")
        self._results: list[Result] = [
            next(result for result in results if result.name == name)
            for name in dict.fromkeys(answers)
        ]
        self._limits: dict[str, Limit] = parse_limits(budgets, self._results)
        plain, self._notes = same_replicas_study_and_notes(study)
        axes = [axis.column for axis in plain.axes if axis.column not in plain.over]
        places = 1
        for axis in plain.axes:
            places *= 1 if axis.column in plain.over else len(axis.labels)
        self._axes, self._places = axes, places
        self._raise_if_only_one_unit(plain)
        found: Alternatives = find_models_to_compare(plain, block, listed, answers)
        self._found = found
        if not found.these:
            whys = [*(f"  {name}: {why}" for name, why in found.unavailable)]
            raise UsageError(
                f"{study.path}: no ladder of its scene has a model that can stand for its own and "
                "changes something; --vary KEY=VALUES lists others",
                *whys,
                *(f"  {note}" for note in found.notes),
            )
        self.study = add_model_axis(plain, found.these)
        self._repeats = repeats
        self._batches: list[Batch] = split_into_batches(self.study, repeats)
        self.turn_times = TurnTimes()
        self._failed: dict[str, str] = {}
        self._folder: StudyFolder | None = None

    def _raise_if_only_one_unit(self, study: Study) -> None:
        members = len(study.cells) // self._places
        if members * study.replicas < 2 or (study.over and members < 2):
            unit = "encounter" if study.over else "run"
            more = "" if study.over else ": --set replicas=2 or more"
            raise UsageError(f"{study.path}: one {unit} cannot tell by how much others would "
                             f"differ{more}")  # fmt: skip

    @property
    def comparison_count(self) -> int:
        """The number of intervals that must hold together: models times results times places."""
        return len(self._found.these) * len(self._results) * self._places

    def run(
        self, path: Path, workers: int, progress: CostProgress, resume: bool = False
    ) -> bool:  # fmt: skip
        """Run all turns, or those that are left, into a folder; return whether ctrl-C ended it."""
        executor = make_executor("local", workers, None)
        folder = self._folder = StudyFolder(path / _RUNS)
        models = len(self._found.these)
        runs = sum(end - start for batch in self._batches for _, start, end in batch)

        def announce_rest(cpu_s: float) -> None:
            share = sum(end - start for _, start, end in self._batches[0]) / runs
            rest_s = cpu_s / share * (1 + models) - cpu_s
            with_so_many = "1 process" if workers == 1 else f"{workers} processes"
            progress.print_if_due(
                f"about {rest_s / workers:.0f} s with {with_so_many}, if each model costs as much "
                "as the scene's own; dearer ones take longer. Ctrl-C keeps what is finished; "
                "--block BLOCK or --set replicas=N asks for less",
                always=True,
            )

        def next_models(done: int) -> list[int]:
            left = self._note_failed_and_list_other_models()
            self.turn_times.save(path / _TURNS, len(self._batches))
            report = self.report()
            going_on = done < len(self._batches)
            progress.print_if_due(
                f"{self.finished_turns_text()}: {_verdict_counts_text(report)}", always=going_on
            )
            return left

        try:
            folder.open(study_json_text(self.study), resume=resume)
            before = self._resume_turns(path / _TURNS) if resume else 0
            progress.print_if_due(
                f"{models} models and the scene as it is, {runs:,} runs each, in "
                f"{len(self._batches)} turns; the scene as it is goes first",
                always=True,
            )
            run_all_models_in_turns(self.study, folder, executor, workers, self._batches,
            self.turn_times,
                         announce_rest, next_models, before)  # fmt: skip
        except KeyboardInterrupt:
            return True
        except (NotWritten, OSError) as error:
            raise UsageError(f"{folder.path}: cannot be written: {error}") from error
        finally:
            executor.close()
            folder.close()
        return False

    def _resume_turns(self, path: Path) -> int:
        """Return how many turns an earlier attempt finished, and split the runs as it planned."""
        kept = self.turn_times.read_and_count_earlier_turns(path)
        if kept is None:
            return 0
        done, turns = kept
        if self._repeats not in (None, turns):
            raise UsageError(f"--repeats {self._repeats}: {path.parent} was begun in {turns} turns")
        self._batches = split_into_batches(self.study, turns)
        return done

    def has_model_runs(self) -> bool:
        """Return whether any model other than the scene's own has runs yet."""
        return any(model for _, model in self.turn_times.runs)

    def _model_name(self, model: int) -> str:
        return str(self.study.axes[-1].labels[model])

    def _note_failed_and_list_other_models(self) -> list[int]:
        """Return indices of models with results in turn one; remember why others failed."""
        assert self._folder is not None
        for table in self._folder.each_part(before_round=1):
            errors = table["error"].to_pylist()
            if all(error is not None for error in errors):
                self._failed[table["model"].to_pylist()[0]] = str(errors[0])
        if self._model_name(0) in self._failed:
            raise UsageError(
                f"{self.study.path}: no run of the scene as it is has a result: "
                f"{self._failed[self._model_name(0)]}"
            )
        return [k for k in range(len(self.study.axes[-1].labels))
                if self._model_name(k) not in self._failed]  # fmt: skip

    def finished_turns_text(self) -> str:
        """Return how many turns are finished as text, such as ``2 of 10 turns``."""
        models = len(self._found.these) + 1 - len(self._failed)
        each = [
            sum(turn == k for turn, _ in self.turn_times.runs) for k in range(len(self._batches))
        ]
        return f"{sum(many >= models for many in each)} of {len(self._batches)} turns"

    def report(self) -> AnswerReport:
        """Return the report on the runs made so far."""
        study, folder = self.study, self._folder
        assert folder is not None
        rows = Rows(StoredRows(folder), [axis.column for axis in study.axes], study.over)
        notes = [*self._notes, *self._found.notes]
        if rows.failed:
            died = f", {rows.crashed:,} as their process died" if rows.crashed else ""
            notes.append(f"{rows.failed:,} runs failed{died}; {_RUNS}/parts says why")
        return AnswerReport(
            title=study.title,
            unit="encounters" if study.over else "replicas",
            axes=self._axes,
            models=[one.name for one in self._found.these],
            results=self._results,
            limits=self._limits,
            confidence=study.confidence,
            comparisons=self.comparison_count,
            changes=changes_by_model(
                rows, self._results, study.confidence, study.interval, self.comparison_count
            ),
            turn_times=self.turn_times,
            failed=self._failed,
            own=self._found.own,
            unavailable=self._found.unavailable,
            notes=notes,
        )


def _verdict_counts_text(report: AnswerReport) -> str:
    every = [verdict for some in report.verdicts.values() for verdict in some]
    taken = sum(verdict.is_same_or_within_limit for verdict in every)
    kinds = [(BEYOND, "beyond the limit"), (OPEN, "open"), (NOTHING, "not compared")]
    parts = [f"{taken} of {len(every)} may be taken"]
    parts += [
        f"{many} {words}" for kind, words in kinds if (many := sum(v.kind == kind for v in every))
    ]
    return ", ".join(parts)


def _rows_to_csv(rows: Sequence[dict[str, Any]]) -> bytes:
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()
