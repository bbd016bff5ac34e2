"""Running a study from Python."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any
from weakref import finalize

from dsa_des.block.registry import class_texts_in
from dsa_des.errors import OutputError, Problem, SceneError, UsageError, did_you_mean
from dsa_des.library.scenes import as_scene
from dsa_des.record.drawing import collect_drawn_figures, pictures_in
from dsa_des.results.figures import draw_figures
from dsa_des.results.folder import StudyFolder
from dsa_des.results.printing import print_study_tables
from dsa_des.results.tables import DIFFERENCES, SUMMARY
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.overrides import SWAP, Change, apply_changes, to_scene_value
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import SceneFile
from dsa_des.studies.executors import make_executor, usable_processor_count
from dsa_des.studies.metric import METRICS, Metric
from dsa_des.studies.runner import (
    Progress,
    Stopped,
    rerun_and_draw_replica,
    result_tables_of_study,
    run_study,
)
from dsa_des.studies.study import Study, changed_scene, portable_command_line
from dsa_des.studies.study_digest import study_json_text
from dsa_des.studies.study_file import read_study, study_of_tables
from dsa_des.terminal.terminal import capture_html, capture_text
from dsa_des.text.safe_text import shorten

if TYPE_CHECKING:
    import pyarrow as pa

_MOST_WORKERS = 1024
_BY_A_PROGRAM = "# run by a program with dsa_des.study(...); its tables stand in study.json"


class StudyResult:
    """The results of a study: tables, runs and figures.

    Parameters
    ----------
    study : Study
    folder : StudyFolder
        With its results.
    home : Path, optional
        Where the folder lies if none was asked for; it goes with this object.
    """

    def __init__(self, study: Study, folder: StudyFolder, home: Path | None = None) -> None:
        self._study, self._folder, self._home = study, folder, home
        if home is not None:
            finalize(self, rmtree, home, ignore_errors=True)
        self._tables = result_tables_of_study(study, folder)
        self._tables.write()
        if home is None:
            _ = self.figures

    @property
    def path(self) -> Path | None:
        """The folder of the study, or None if none was asked for."""
        return self._folder.path if self._home is None else None

    @cached_property
    def summary(self) -> "pa.Table":
        """One row for every result at every combination of axis values, with its interval."""
        return self._table(SUMMARY)

    @cached_property
    def differences(self) -> "pa.Table | None":
        """Paired differences from the baseline; None for a study that compares nothing."""
        return self._table(DIFFERENCES) if self._tables.compared else None

    @cached_property
    def runs(self) -> "pa.Table":
        """One row for every run: its cell, replica, seed, drawn values and results."""
        return self._folder.results()

    @cached_property
    def figures(self) -> dict[str, Any]:
        """All figures by name."""
        with collect_drawn_figures() as drawn:
            draw_figures(
                self._tables, (), partial(rerun_and_draw_replica, self._study, self._folder)
            )
        return {**pictures_in(self._folder.path), **drawn}

    def figure(self, name: str) -> Any:
        """Return one of the study's figures: a matplotlib figure with a method ``save(path)``.

        Raises
        ------
        UsageError
            If there is none of this name.
        """
        if name not in self.figures:
            raise UsageError(f"the study has no figure {name!r}{did_you_mean(name, self.figures)}")
        return self.figures[name]

    def _table(self, name: str) -> "pa.Table":
        table = self._folder.table(name)
        if table is None:
            raise UsageError(f"{self._folder.path / name}: is not there or not of this study")
        return table

    def _repr_html_(self) -> str:
        return capture_html(lambda console: print_study_tables(console, self._tables))

    def __str__(self) -> str:
        return capture_text(lambda console: print_study_tables(console, self._tables), 160)

    def __repr__(self) -> str:
        rows = self._tables.rows
        where = "in memory" if self._home is not None else f"in {shorten(str(self.path))}"
        axes = ", ".join(f"{axis.column} ({len(axis.labels)})" for axis in self._study.axes)
        results = ", ".join(result.name for result in self._tables.results)
        return "\n".join(
            [
                f"Study {shorten(repr(self._study.title))}, {where}",
                f"  {len(rows.places) + rows.failed} runs, {rows.failed} failed",
                f"  axes: {shorten(axes or 'none', 200)}",
                f"  results: {shorten(results, 200)}",
            ]
        )


def study(
    scene: Scene | str | os.PathLike[str] | Mapping[str, Any],
    *,
    metrics: Sequence[str | type[Metric] | Mapping[str, Any]] | None = None,
    axes: Mapping[str, Any] | None = None,
    draws: Mapping[str, Any] | None = None,
    replicas: int | None = None,
    seed: int | None = None,
    sets: Iterable[str] = (),
    workers: int | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    **more: Any,
) -> StudyResult:
    """Run a scene over axes, draws and replicas, or a study file, and return the results.

    Parameters
    ----------
    scene : Scene, or what `dsa_des.load_scene` takes
        Without `metrics`: the path of a study file, or the name of a shipped study.
    metrics : sequence, optional
        Registered names, ``module:Class``, classes, or tables ``{"metric": NAME, ...}``. Left out
        for a study file, which says itself what it measures, over which axes and how often.
    axes, draws : mapping, optional
        Dotted key → values or distribution, as in a study file; ``swap.BLOCK`` → types. Of a study
        file given with them, they take the place.
    replicas, seed : int, optional
        1 and 0 for a scene; those of the file for a study file.
    sets : iterable of str
        Changes of a study file as the command line takes them: ``key=value``.
    workers : int, optional
        Processes. By default one for each processor, and this process alone where a class of the
        study cannot be imported by others.
    out : path, optional
        Folder of the study; without, results stay with what is returned.
    resume : bool
        Whether a study that `out` holds is continued.
    progress : callable, optional
        Called with a `Progress` whenever some runs are done.
    **more
        Further keys of a study file: ``title``, ``compare``, ``over``, ``stop_when``,
        ``confidence``, ``interval``, ``figures``, ``runs_per_chunk``.

    Returns
    -------
    StudyResult

    Raises
    ------
    SceneError
        With every problem of the study and its scene.
    UsageError
        If the results cannot go into the folder, or workers cannot import a class.
    OutputError
        If results cannot be written; what is finished is kept in `out`.
    """
    if metrics is None:
        keys = {"axes": axes, "draws": draws, "replicas": replicas, "seed": seed, **more}
        described = _study_of_file(scene, {k: v for k, v in keys.items() if v is not None}, sets)
        return _run_study(
            described, _default_worker_count(described, workers), out, resume, progress
        )
    if sets := list(sets):
        message = "changes a study file; a scene is changed with load_scene(..., sets=...)"
        raise SceneError([Problem("study", "sets", message, sets)])
    loaded = as_scene(scene)
    given = {
        "title": loaded.title,
        "seed": 0 if seed is None else seed,
        "replicas": 1 if replicas is None else replicas,
        "axes": axes or {},
        "draws": draws or {},
        "metrics": list(metrics),
        **more,
    }
    tables = _keywords_as_tables(given)
    for key in {"scene", "set", "swap"} & tables.keys():
        message = "is no keyword: give a scene, and change it with scene.set and scene.swap"
        raise SceneError([Problem("study", key, message)])
    described = study_of_tables(tables, *_tables_swaps_and_changes(*loaded.origin))
    described.repeat = _BY_A_PROGRAM
    return _run_study(described, _default_worker_count(described, workers), out, resume, progress)


def _study_of_file(source: Any, given: Mapping[str, Any], sets: Iterable[str]) -> Study:
    """Return the study that a study file describes, by path or name of a shipped one."""
    if not isinstance(source, str | os.PathLike):
        message = "is missing: a scene is measured by metrics; only a study file names its own"
        raise SceneError([Problem("study", "metrics", message)])
    name = os.fspath(source)
    path = find_input_file(name, "study")
    described = read_study(path, sets=(sets := list(sets)), keys=_keywords_as_tables(given))
    described.repeat = _BY_A_PROGRAM
    if given.keys() <= {"replicas", "seed"}:
        words = [word for key, value in given.items() for word in (f"--{key}", str(value))]
        described.repeat = portable_command_line(["study", *words], sets, path)
    return described


def _keywords_as_tables(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return keyword arguments in the form of the tables of a study file."""
    tables: dict[str, Any] = {}
    for key, value in given.items():
        try:
            tables[key] = (
                to_scene_value(value, METRICS) if key == "metrics" else to_scene_value(value)
            )
        except TypeError as error:
            raise SceneError([Problem("study", key, str(error))]) from None
    return tables


def _tables_swaps_and_changes(
    file: SceneFile, changes: Sequence[Change]
) -> tuple[SceneFile, list[tuple[str, str]], list[Change]]:
    """Return (original scene, swaps as (block, type), other changes), or where this order would
    differ (changed scene, [], []).

    Where that order would give another scene, the changed tables, and no changes.
    """
    swaps = [(k.removeprefix(SWAP), v) for k, v in changes if k.startswith(SWAP)]
    sets = list({k: v for k, v in changes if not k.startswith(SWAP)}.items())
    changed, ordered = file.copy(), file.copy()
    apply_changes(changed, changes)
    apply_changes(ordered, [*((SWAP + block, name) for block, name in swaps), *sets])
    same = not changed.problems and not ordered.problems and ordered.data == changed.data
    with suppress(SceneError):
        if same:
            changed_scene(file, swaps, sets, "study")
            return file, swaps, sets
    return changed, [], []


def _default_worker_count(study: Study, workers: int | None) -> int:
    if workers is not None and not (
        isinstance(workers, int) and not isinstance(workers, bool) and 1 <= workers <= _MOST_WORKERS
    ):
        raise UsageError(f"workers is {workers!r}: it must be a whole number, 1 to {_MOST_WORKERS}")
    strange = class_texts_in(
        [
            study.base.data,
            [name for _, name in study.swaps],
            [axis.swaps for axis in study.axes],
            [axis.sets for axis in study.axes],
            [value for _, value in study.sets],
            [spec.name for spec in study.metrics],
        ]
    )
    if strange and workers is None:
        return 1
    if strange and workers != 1:
        name = str(strange[0])
        raise UsageError(
            f"workers is {workers}: other processes cannot import {name}, which is defined in a "
            "program, a notebook or a function; put it into a module, or take workers=1"
        )
    return workers or usable_processor_count()


def _run_study(
    study: Study,
    workers: int,
    out: str | os.PathLike[str] | None,
    resume: bool,
    progress: Callable[[Progress], None] | None,
) -> StudyResult:
    if out is None and resume:
        raise UsageError("resume continues the study in a folder: give out")
    # Beside nothing of the user's, and on the disk: a study may be larger than memory.
    home = Path(mkdtemp(prefix="dsa_des-")) if out is None else None
    try:
        folder = StudyFolder(home / "study" if home is not None else Path(out or ""))
        _run_into_folder(folder, study, workers, resume, progress)
        return StudyResult(study, folder, home)
    except BaseException:
        if home is not None:
            rmtree(home, ignore_errors=True)
        raise


def _run_into_folder(
    folder: StudyFolder,
    study: Study,
    workers: int,
    resume: bool,
    progress: Callable[[Progress], None] | None,
) -> None:
    executor = make_executor("local", workers, None)
    try:
        folder.open(study_json_text(study), resume=resume)
        run_study(study, folder, executor, progress or (lambda _: None))
    except Stopped as stop:
        if str(stop) == "interrupted":
            raise KeyboardInterrupt from None
        raise OutputError(f"{folder.path}: {stop}") from None
    finally:
        executor.close()
        folder.close()
