"""Running a study: rounds of chunks, parts on disk, and stopping where results are good enough."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dsa_des.errors import SceneError
from dsa_des.replicas import why_apart
from dsa_des.studies.executors import Executor
from dsa_des.studies.folder import StudyFolder
from dsa_des.studies.metric import Result
from dsa_des.studies.study import Study
from dsa_des.studies.summary import Rows


@dataclass
class Progress:
    """How far a study is."""

    runs: int = 0
    failed: int = 0
    total: int = 0


class Stopped(Exception):
    """A study was interrupted, or its results could not be written; it can be resumed."""


def results_of(study: Study) -> list[Result]:
    """Return the results that a study's metrics give."""
    scene = study.scene(0)
    return [result for spec in study.metrics for result in spec.build(scene).results()]


def why_one_by_one(study: Study) -> str | None:
    """Return why replicas of the first or the last cell cannot run in lock step, if so."""
    replicas = [study.replica(number) for number in range(min(2, study.replicas))]
    if len(replicas) < 2:
        return None
    for cell in sorted({0, len(study.cells) - 1}):
        try:
            reason = why_apart(study.scene(cell), replicas)
        except SceneError:  # its rows say so
            continue
        if reason is not None:
            return reason
    return None


def run_study(
    study: Study,
    folder: StudyFolder,
    executor: Executor,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Run what is missing of a study into its folder.

    Parameters
    ----------
    study : Study
    folder : StudyFolder
        Open.
    executor : Executor
    report : callable
        Told of every chunk that is done.

    Raises
    ------
    Stopped
        On ctrl-C or when the disk is full; what is finished is kept.
    """
    progress = Progress(total=len(study.cells) * study.replicas)
    cells = list(range(len(study.cells)))
    rounds = -(-study.replicas // study.batch)
    for number in range(rounds):
        if number and study.stop_when is not None:
            satisfied = _satisfied(study, folder)
            left = [cell for cell in cells if cell not in satisfied]
            done_with = len(cells) - len(left)
            progress.total -= done_with * (study.replicas - number * study.batch)
            cells = left
        missing = []
        for chunk in study.chunks(number, cells):
            if folder.has(chunk.name):
                runs, failed = folder.failed_in(chunk.name)
                progress.runs += runs
                progress.failed += failed
            else:
                missing.append(chunk)
        report(progress)
        try:
            for done in executor.run(study, missing):
                folder.write_part(done.name, done.content)
                progress.runs += done.runs
                progress.failed += done.failed
                report(progress)
        except KeyboardInterrupt:
            raise Stopped("interrupted") from None
        except OSError as error:
            raise Stopped(f"results cannot be written: {error.strerror or error}") from error
        if not cells:
            break
    return progress


def _satisfied(study: Study, folder: StudyFolder) -> set[int]:
    """Return the cells whose interval is narrow enough."""
    stop = study.stop_when
    assert stop is not None
    result = next(item for item in results_of(study) if item.name == stop.metric)
    rows = Rows(folder.results(), ["cell"], [])
    found = set()
    for (cell,), chosen in rows.each_place():
        estimate, _ = rows.estimate(result, chosen, study.confidence, study.interval)
        if not np.isnan(estimate.half_width) and estimate.half_width <= stop.half_width:
            found.add(int(cell))
    return found


class Clock:
    """Rate and time left of a study that is running."""

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._already: int | None = None

    def text(self, progress: Progress) -> str:
        """Return ``1200 of 10000 runs, 310/s, 28 s left, 2 failed``."""
        if self._already is None:
            self._already = progress.runs
        spent = time.monotonic() - self._started
        done = progress.runs - self._already
        words = [f"{progress.runs} of {progress.total} runs"]
        if done and spent > 0:
            rate = done / spent
            left = (progress.total - progress.runs) / rate
            words += [f"{rate:.3g}/s", f"{left:.0f} s left"]
        if progress.failed:
            words.append(f"{progress.failed} failed")
        return ", ".join(words)
