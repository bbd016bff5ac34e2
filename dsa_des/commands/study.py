"""``dsa-des study``: run a study, continue it, or show what it came to."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dsa_des import terminal
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.run_folder import new_folder_name
from dsa_des.safe_text import shortened
from dsa_des.studies.executors import default_workers, make_executor
from dsa_des.studies.folder import StudyFolder, description
from dsa_des.studies.output import Tables
from dsa_des.studies.printing import show
from dsa_des.studies.runner import Clock, Stopped, results_of, run_study, why_one_by_one
from dsa_des.studies.study import Study
from dsa_des.studies.study_file import read_study, study_again
from dsa_des.terminal import say

_HOME = Path("studies")


def study_command(
    words: tuple[str, ...],
    sets: tuple[str, ...],
    workers: int | None,
    resume: bool,
    executor: str,
    scheduler: str | None,
    out: str | None,
    metrics: bool,
    quiet: bool,
) -> None:
    """Do what the command line asks for."""
    if metrics:
        _list_metrics()
    elif len(words) == 2 and words[0] == "show":
        show_study(Path(words[1]))
    elif len(words) == 1 and words[0] != "show":
        study = read_study(words[0], sets=sets)
        folder = run_into(study, _target(study, out, resume), workers, resume, executor, scheduler)
        finish(study, folder, quiet=quiet)
    else:
        raise UsageError("give STUDY.toml, or: show FOLDER")


def _target(study: Study, out: str | None, resume: bool) -> Path:
    if out is not None:
        return Path(out)
    if resume:
        earlier = sorted(_HOME.glob(f"{study.path.stem}-[0-9]*"))
        if not earlier:
            raise UsageError(f"--resume: there is no {_HOME / study.path.stem}-NNN to continue")
        return earlier[-1]
    return new_folder_name(_HOME, study.path.stem)


def run_into(
    study: Study,
    path: Path,
    workers: int | None,
    resume: bool,
    kind: str = "local",
    scheduler: str | None = None,
) -> StudyFolder:
    """Run a study into a folder; exit code 1 or 130 when it is stopped and can be resumed."""
    if workers is not None and workers < 1:
        raise UsageError(f"--workers is {workers}: it must be 1 or more")
    executor = make_executor(kind, workers or default_workers(), scheduler)
    folder = StudyFolder(path)
    try:
        folder.open(study, resume=resume)
        with folder.locked(), _progress(study) as report:
            run_study(study, folder, executor, report)
    except Stopped as stop:
        again = f"dsa-des study {study.path} --resume --out {path}"
        say(f"stopped: {stop}; what is finished is kept, continue with", err=True)
        say(f"  {again}", err=True)
        sys.exit(130 if str(stop) == "interrupted" else 1)
    finally:
        executor.close()
    return folder


def finish(
    study: Study, folder: StudyFolder, *, quiet: bool = False, only: Sequence[str] = ()
) -> Tables:
    """Write the tables of a finished study, draw its figures and print them.

    `only` names the results to print; by default those that the study draws.
    """
    tables = Tables(study, folder)
    try:
        tables.write()
        figures = tables.draw(only)
    except OSError as error:
        raise UsageError(f"{folder.path}: cannot be written: {error.strerror}") from error
    if not quiet:
        show(terminal.console(160), tables, only)
        for path in figures:
            say(f"wrote {path}")
        if reason := why_one_by_one(study):
            say(f"replicas ran one by one where they cannot run in lock step: {reason}")
        say()
        say(f'pandas.read_parquet("{folder.parts}") opens all {_count(tables)} runs')
    return tables


def _count(tables: Tables) -> int:
    return len(tables.rows.places) + tables.rows.failed


def read_study_of(folder: StudyFolder) -> Study:
    """Return the study that a folder was made of.

    Raises
    ------
    UsageError
        If the folder is no study, or its scene has changed since.
    """
    about = folder.about()
    study = study_again(Path(about["study"]), about["tables"])
    if description(study)["study_sha256"] != about["study_sha256"]:
        raise UsageError(
            f"{folder.path}: the scene {about['scene']}, a file that it names, or dsa_des "
            "has changed since the study was run; run it again"
        )
    return study


def show_study(path: Path, only: Sequence[str] = ()) -> None:
    """Print all tables of a study's folder, or those of some results; draw its figures again."""
    folder = StudyFolder(path)
    study = read_study_of(folder)
    finish(study, folder, only=only or known_results(study, only))


def known_results(study: Study, only: Sequence[str]) -> list[str]:
    """Return the names of all results of a study.

    Raises
    ------
    UsageError
        If one of `only` is none of them.
    """
    every = [result.name for result in results_of(study)]
    for name in only:
        if name not in every:
            raise UsageError(f"--metric {name}: there is no such result{did_you_mean(name, every)}")
    return every


@contextmanager
def _progress(study: Study) -> Iterator[Any]:
    """Show a progress bar on a terminal, and a line now and then elsewhere."""
    clock = Clock()
    if sys.stderr.isatty():
        with terminal.progress("text") as bar:
            task = bar.add_task(shortened(study.title), total=None, text="")

            def update(progress: Any) -> None:
                text = clock.text(progress)
                bar.update(task, total=progress.total, completed=progress.runs, text=text)

            yield update
        return
    import time

    last = time.monotonic()

    def note(progress: Any) -> None:
        nonlocal last
        text = clock.text(progress)
        if time.monotonic() - last > 10:
            last = time.monotonic()
            say(text, err=True)

    yield note


def _list_metrics() -> None:
    from rich.table import Table

    from dsa_des.commands.components import parameter_rows
    from dsa_des.entry_points import registered
    from dsa_des.studies.metric import METRICS, find_metric

    console = terminal.console(120)
    table = Table(box=None, pad_edge=False)
    for heading in ("metric", "reads", "keys", "what it is"):
        table.add_column(heading, no_wrap=heading == "metric")
    for name in registered(METRICS):
        try:
            cls = find_metric(name)
        except ValueError as error:  # somebody's broken plug-in must not hide the others
            table.add_row(name, "", "", str(error))
            continue
        keys = ", ".join(row[0].strip() for row in parameter_rows(cls.Parameters))
        text = (cls.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        table.add_row(name, ", ".join(cls.tables), keys, " ".join(text.split()))
    console.print(table)
