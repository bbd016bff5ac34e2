"""``dsa-des study``: run a study, continue it, or show what it came to."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from dsa_des.errors import BlockFailure, Problem, SceneError, UsageError, did_you_mean
from dsa_des.files.output_file import check_file_writable, write_file
from dsa_des.files.output_names import check_folder_path, make_numbered_folder, user_path
from dsa_des.results.figures import draw_figures
from dsa_des.results.folder import STUDY_JSON, StudyFolder, latest_folder
from dsa_des.results.printing import print_study_tables
from dsa_des.results.record import Result, StudyRecord
from dsa_des.results.rows import StoredRows
from dsa_des.results.tables import DIFFERENCES, RATIOS, REQUIREMENTS, SUMMARY, Tables
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.overrides import parse_assignment
from dsa_des.studies.executors import make_executor, usable_processor_count
from dsa_des.studies.runner import (
    Clock,
    Progress,
    Stopped,
    rerun_and_draw_replica,
    result_tables_of_study,
    run_study,
    study_lock_step_refusal,
)
from dsa_des.studies.study import Study, portable_command_line
from dsa_des.studies.study_digest import study_json_text
from dsa_des.studies.study_file import read_study
from dsa_des.terminal import terminal
from dsa_des.terminal.terminal import say, say_json
from dsa_des.text.safe_text import shell_line, shorten

_HOME = Path("studies")
_MOST_WORKERS = 1024
_LONGEST_ERROR = 500


def study_command(
    study: str | None,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    replicas: int | None,
    workers: int | None,
    resume: bool,
    executor: str,
    scheduler: str | None,
    out: str | None,
    metrics: bool,
    no_figures: bool,
    measure: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Run a study as the command line says; exit with code 1 if runs crashed and 130 on ctrl-C."""
    if metrics:
        _list_metrics()
        return
    if study is None:
        raise UsageError("give a STUDY (dsa-des examples lists those that are shipped)")
    name, path = study, find_input_file(study, "study")
    sets = (*sets, *options_as_sets(swaps, seed, replicas))
    described = read_study(path, sets=sets)
    described.repeat = portable_command_line(["study"], sets, described.path)

    def resume_command(folder: Path) -> str:
        return _resume_command(name, folder, sets, workers, executor, scheduler, measure)

    target = choose_output_folder(_HOME, described.path.stem, out, resume)
    folder = run_study_into_folder(
        described, target, workers, resume, resume_command, executor, scheduler
    )
    try:
        tables = write_and_print_finished_study(
            described, folder, quiet=quiet or as_json, draw=not no_figures, as_json=as_json
        )
        if measure:
            _measure_model_errors(folder, silent=quiet)
    except KeyboardInterrupt:
        exit_with_resume_hint("interrupted", resume_command(folder.path), 130)
    exit_if_runs_crashed([tables], resume_command(folder.path))


def options_as_sets(swaps: Sequence[str], seed: int | None, replicas: int | None) -> list[str]:
    """Return the options as ``--set`` texts: ``swap.BLOCK=TYPE``, ``seed=N``, ``replicas=N``."""
    sets = []
    for swap in swaps:
        parsed = parse_assignment(swap, "--swap")
        if isinstance(parsed, Problem):
            raise SceneError([parsed])
        sets.append(f"swap.{parsed[0]}={parsed[1]}")
    if seed is not None:
        sets.append(f"seed={seed}")
    if replicas is not None:
        sets.append(f"replicas={replicas}")
    return sets


def show_command(folder: str, no_figures: bool, as_json: bool) -> None:
    """Print the tables of a study's folder."""
    print_and_redraw_study(Path(folder), draw=not no_figures, as_json=as_json)


def require_empty_or_resumed(
    location: "Path | Callable[[], Path]", resume: bool, what: str
) -> None:
    """Raise UsageError where a folder is not empty and the command does not resume."""
    if isinstance(location, Path):
        check_folder_path(location)
        if location.is_dir() and any(location.iterdir()) and not resume:
            raise UsageError(f"--out {location}: is not empty; --resume continues {what}")


def choose_output_folder(
    home: Path, stem: str, out: str | None, resume: bool
) -> "Path | Callable[[], Path]":
    """Return ``--out``, or with `resume` the latest ``stem-NNN``, else a function to make one."""
    if out is not None:
        return user_path(out)
    if resume:
        earlier = latest_folder(home, stem)
        if earlier is None:
            raise UsageError(f"--resume: there is no {home / stem}-NNN to continue")
        return earlier
    return lambda: make_numbered_folder(home, stem)


def _resume_command(
    study: str,
    path: Path,
    sets: Sequence[str],
    workers: int | None,
    executor: str,
    scheduler: str | None,
    measure: bool,
) -> str:
    """Return the shell command that continues a study."""
    words = ["dsa-des", "study", "--resume", "--out", str(path)]
    for assignment in sets:
        words += ["--set", assignment]
    if workers is not None:
        words += ["--workers", str(workers)]
    if executor != "local":
        words += ["--executor", executor]
    if scheduler is not None:
        words += ["--scheduler", scheduler]
    words += ["--measure"] if measure else []
    # A name that begins with a dash is no option.
    return shell_line([*words, *(["--"] if study.startswith("-") else []), study])


def exit_with_resume_hint(reason: str, again: str, code: int) -> NoReturn:
    """Print why a study stopped and the command that continues it, and exit with `code`."""
    say(f"stopped: {reason}; what is finished is kept, continue with", err=True)
    say(f"  {again}", err=True)
    sys.exit(code)


def exit_if_runs_crashed(result: Sequence[Tables], again: str) -> None:
    """If runs crashed, print how many and the command to retry; exit with code 1."""
    crashed = sum(tables.rows.crashed for tables in result)
    if crashed:
        runs = sum(_count_crashed_runs(tables) for tables in result)
        say(
            f"{crashed} of {runs} runs crashed: the process that ran them died each time; "
            "try them again with",
            err=True,
        )
        say(f"  {again}", err=True)
        sys.exit(1)


def check_workers(workers: int | None) -> None:
    """Raise UsageError unless the worker number is None, or at least 1 and not too large."""
    if workers is not None and workers < 1:
        raise UsageError(f"--workers is {workers}: it must be 1 or more")
    if workers is not None and workers > _MOST_WORKERS:
        raise UsageError(f"--workers is {workers}: at most {_MOST_WORKERS} are allowed")


def run_study_into_folder(
    study: Study,
    path: "Path | Callable[[], Path]",
    workers: int | None,
    resume: bool,
    again: "str | Callable[[Path], str]" = "the same with --resume",
    kind: str = "local",
    scheduler: str | None = None,
) -> StudyFolder:
    """Run a study into a folder and return it; exit with 1 or 130 if stopped and resumable.

    UsageError where no run gave a result. `path` is the folder, or what makes a new one; `again` is
    the command that continues there.
    """
    check_workers(workers)
    executor = make_executor(kind, workers or usable_processor_count(), scheduler)
    folder: StudyFolder | None = None
    try:
        folder = StudyFolder(path if isinstance(path, Path) else path())
        folder.open(study_json_text(study), resume=resume)
        with _show_progress(study) as report:
            _raise_if_all_runs_failed(study, folder, run_study(study, folder, executor, report))
    except Stopped as stop:
        assert folder is not None
        code = 130 if str(stop) == "interrupted" else 1
        exit_with_resume_hint(
            str(stop), again if isinstance(again, str) else again(folder.path), code
        )
    except KeyboardInterrupt:
        if folder is None or not (folder.path / STUDY_JSON).exists():
            sys.exit(130)
        command = again if isinstance(again, str) else again(folder.path)
        exit_with_resume_hint("interrupted", command, 130)
    finally:
        executor.close()
        if folder is not None:
            folder.close()
    return folder


def _raise_if_all_runs_failed(study: Study, folder: StudyFolder, progress: Progress) -> None:
    """Raise UsageError with the first run's error if every run of a study failed."""
    if 0 < progress.failed == progress.runs and not progress.crashed:
        why = shorten(str(StoredRows(folder).failed[0]["error"]), _LONGEST_ERROR)
        raise UsageError(
            f"{study.path.name}: none of its {progress.runs} runs gave a result; the first: {why}",
            f"  `error` and `command` in {folder.parts} say it of each",
        )


def write_and_print_finished_study(
    study: "Study | StudyRecord", folder: StudyFolder, *, quiet: bool = False,
    only: Sequence[str] = (), first: "Callable[[Tables], None]" = lambda tables: None,
    draw: bool = True, as_json: bool = False,
) -> Tables:  # fmt: skip
    """Write the tables of a finished study, draw its figures, print the tables, and return them.

    `only` names the results to print; by default those that the study draws. `first` prints what
    stands before the tables; without `draw` there are no figures; `as_json` prints the tables as
    JSON and nothing else.
    """
    if isinstance(study, Study):
        tables, again = (
            result_tables_of_study(study, folder),
            partial(rerun_and_draw_replica, study, folder),
        )
    else:  # nothing of the folder's is imported, so nothing is run
        tables, again = Tables(study, folder), None
    try:
        tables.write()
        figures = draw_figures(tables, only, again) if draw else []
    except OSError as error:
        raise UsageError(f"{folder.path}: cannot be written: {error.strerror or error}") from error
    if as_json:
        say_json(_tables_as_json(tables, figures))
    elif not quiet:
        first(tables)
        print_study_tables(terminal.console(160), tables, only)
        for path in figures:
            say(f"wrote {path}")
        if isinstance(study, Study) and (reason := study_lock_step_refusal(study)):
            say(f"replicas ran one by one where they cannot run in lock step: {reason}")
        say()
        say(f'pandas.read_parquet("{folder.parts}") opens all {_count_crashed_runs(tables)} runs')
    return tables


def _tables_as_json(tables: Tables, figures: Sequence[Path]) -> dict[str, Any]:
    """Return a study's tables as lists of rows, run counts, and paths of folder and figures."""
    rows = {
        name.removesuffix(".parquet"): [] if table is None else table.to_pylist()
        for name in (SUMMARY, DIFFERENCES, RATIOS, REQUIREMENTS)
        for table in [tables.folder.table(name)]
    }
    return {
        "folder": str(tables.folder.path),
        "runs": _count_crashed_runs(tables),
        "failed": tables.rows.failed,
        "crashed": tables.rows.crashed,
        "undone": tables.folder.failure_counts(),
        **rows,
        "figures": [str(path) for path in figures],
    }


def _count_crashed_runs(tables: Tables) -> int:
    return len(tables.rows.places) + tables.rows.failed


def print_and_redraw_study(
    path: Path, only: Sequence[str] = (), first: "Callable[[Tables], None]" = lambda tables: None,
    draw: bool = True, as_json: bool = False,
) -> None:  # fmt: skip
    """Print all tables of a study's folder, or those of some results; draw its figures again.

    The folder's tables are read and nothing else: no scene, and no code that it names.
    """
    folder = StudyFolder(path)
    every = summarised_result_names(folder.record.results, only)
    write_and_print_finished_study(
        folder.record, folder, only=only or every, first=first, draw=draw, as_json=as_json
    )


def _measure_model_errors(folder: StudyFolder, silent: bool = False) -> None:
    """Measure the errors of the models of a study's first run, and keep them in its folder."""
    from dsa_des.commands.cost import CostProgress
    from dsa_des.costs.models import measure_and_store_errors

    try:
        measure_and_store_errors(folder, CostProgress(silent=silent).print_if_due)
    except (SceneError, BlockFailure) as error:
        say(f"errors of the models were not measured: {error}", err=True)
    except OSError as error:
        raise UsageError(f"{folder.path}: cannot be written: {error.strerror or error}") from error


def report_command(folder: str, out: str | None, no_figures: bool, measure: bool) -> None:
    """Write one HTML page about a study's folder, into that folder or to the path `out`."""
    from dsa_des.results.report import REPORT, study_report

    path = Path(folder)
    study = StudyFolder(path)
    target = path / REPORT if out is None else user_path(out)
    if out is not None:
        check_file_writable(target)
    if measure:
        _measure_model_errors(study)
    try:
        if not no_figures:
            draw_figures(Tables(study.record, study))
        write_file(target, study_report(study))
    except OSError as error:
        raise UsageError(f"{target}: cannot be written: {error.strerror or error}") from error
    say(f"wrote {target}")


def summarised_result_names(
    results: Sequence[Result], only: Sequence[str], option: str = "--metric"
) -> list[str]:
    """Return the names of all summarised results; UsageError if `only` has another name."""
    every = [result.name for result in results if result.is_summarised]
    for name in only:
        if name not in every:
            raise UsageError(f"{option} {name}: there is no such result{did_you_mean(name, every)}")
    return every


@contextmanager
def _show_progress(study: Study) -> Iterator[Any]:
    """Yield a function that shows progress: a bar on a terminal, else a line every 10 s at most."""
    clock = Clock()
    if sys.stderr.isatty():
        with terminal.progress_bar("text") as bar:
            task = bar.add_task(shorten(study.title), total=None, text="")

            def update(progress: Any) -> None:
                text = clock.progress_text(progress)
                bar.update(task, total=progress.total, completed=progress.runs, text=text)

            yield update
        return
    import time

    last = time.monotonic()

    def note(progress: Any) -> None:
        nonlocal last
        text = clock.progress_text(progress)
        if time.monotonic() - last > 10:
            last = time.monotonic()
            say(text, err=True)

    yield note


def _list_metrics() -> None:
    from rich.table import Table

    from dsa_des.block.entry_points import entry_points_of
    from dsa_des.commands.parameters import parameter_rows
    from dsa_des.studies.metric import METRICS, find_metric

    console = terminal.console(120)
    table = Table(box=None, pad_edge=False)
    for heading in ("metric", "reads", "keys", "what it is"):
        table.add_column(heading, no_wrap=heading == "metric")
    for name in entry_points_of(METRICS):
        try:
            cls = find_metric(name)
        except ValueError as error:  # a broken plug-in must not hide the others
            table.add_row(name, "", "", str(error))
            continue
        keys = ", ".join(row[0].strip() for row in parameter_rows(cls.Parameters))
        text = (cls.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        table.add_row(name, ", ".join(cls.tables), keys, " ".join(text.split()))
    console.print(table)
