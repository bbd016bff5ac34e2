"""Running a study's models in turns: a batch of runs with each of them, then the next batch.

What the machine does meanwhile meets all of them alike, so the processor time of a model is taken
by that of the scene as it is *in the same turn*. The turns follow from the study alone, and the
rows of a chunk from the chunk: any number of workers gives the same.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dsa_des.costs.replay import median_and_half_iqr
from dsa_des.errors import UsageError
from dsa_des.files.output_file import write_file
from dsa_des.results.folder import StudyFolder
from dsa_des.studies.executors import Executor
from dsa_des.studies.study import Chunk, Study

#: Some cells, counted without the axis of models, and the first and last replica of each.
Batch = list[tuple[int, int, int]]
#: Fewer turns tell nothing of how much a time varies; more make batches small.
_FEWEST, _MOST = 5, 16


def split_into_batches(study: Study, many: int | None = None) -> list[Batch]:
    """Split runs with models as last axis into batches of sampled encounters or, if more, replicas.

    By default each is as large as the study's chunks.
    """
    cells = range(math.prod(len(axis.labels) for axis in study.axes[:-1]))
    members: dict[Any, list[int]] = {}
    sizes = [len(axis.labels) for axis in study.axes[:-1]]
    sampled = [k for k, axis in enumerate(study.axes) if axis.column in study.over]
    for cell in cells:
        indices = np.unravel_index(cell, sizes) if sizes else ()
        members.setdefault(tuple(int(indices[k]) for k in sampled), []).append(cell)
    groups = list(members.values())
    by_member = len(groups) >= study.replicas
    units = len(groups) if by_member else study.replicas
    per_unit = study.replicas if by_member else 1
    if many is None:
        many = min(_MOST, max(_FEWEST, -(-units * per_unit // study.runs_per_chunk)))
    edges = np.linspace(0, units, min(many, units) + 1).round().astype(int).tolist()
    batches = []
    for start, end in pairwise(edges):
        if by_member:
            some = sorted(cell for group in groups[start:end] for cell in group)
            batches.append([(cell, 0, study.replicas) for cell in some])
        else:
            batches.append([(cell, start, end) for cell in cells])
    return batches


@dataclass
class TurnTimes:
    """What the runs of each model took of the processor, turn by turn."""

    #: By turn and model.
    cpu_s: dict[tuple[int, int], float] = field(default_factory=dict)
    runs: dict[tuple[int, int], int] = field(default_factory=dict)

    def save(self, path: Path, turns: int) -> None:
        """Write the CPU times measured so far and the planned number of turns to a JSON file."""
        taken = [[*key, self.cpu_s[key], self.runs[key]] for key in sorted(self.runs)]
        write_file(path, json.dumps({"turns": turns, "taken": taken}).encode())

    def read_and_count_earlier_turns(self, path: Path) -> tuple[int, int] | None:
        """Read an earlier attempt's times; return (finished, planned) turns; None without file."""
        try:
            content = json.loads(path.read_bytes())
            turns = int(content["turns"])
            for turn, model, cpu_s, runs in content["taken"]:
                self.cpu_s[int(turn), int(model)] = float(cpu_s)
                self.runs[int(turn), int(model)] = int(runs)
        except FileNotFoundError:  # not one turn was finished
            return None
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            said = "is damaged; without it all turns are run again"
            raise UsageError(f"{path}: {said}") from error
        return 1 + max(self.runs)[0], turns

    def run_cpu_ms_and_spread(self, model: int) -> tuple[float, float]:
        """Return a model's CPU time per run, ms: median and half interquartile range of turns."""
        each = [1e3 * self.cpu_s[key] / self.runs[key] for key in sorted(self.cpu_s)
                if key[1] == model]  # fmt: skip
        return median_and_half_iqr(each)

    def relative_cpu_and_spread(self, model: int) -> tuple[float, float]:
        """Return a model's CPU time per run divided by that of the scene as it is: the median over
        the turns that have both, and half the interquartile range.
        """
        turns = sorted(turn for turn, of in self.cpu_s if of == model and (turn, 0) in self.cpu_s)
        each = [
            (self.cpu_s[turn, model] / self.runs[turn, model])
            / (self.cpu_s[turn, 0] / self.runs[turn, 0])
            for turn in turns
        ]
        return median_and_half_iqr(each)


def run_all_models_in_turns(
    study: Study,
    folder: StudyFolder,
    executor: Executor,
    workers: int,
    batches: Sequence[Batch],
    turn_times: TurnTimes,
    begun: Callable[[float], None],
    after: Callable[[int], Sequence[int]],
    done: int = 0,
) -> None:
    """Run all models batch by batch (a turn each); write results to the open `folder`, times to
    `turn_times`; ``after(turns done)`` returns the models to go on with.

    `begun` is told how long the scene as it is took in the first turn; `after` is told after each
    turn how many are done, and returns the models to go on with. `turn_times` is filled on the way;
    it holds those of turns that were `done` before.
    """
    models, parts = len(study.axes[-1].labels), folder.parts_destination

    def chunks(turn: int, some: Sequence[int]) -> Iterator[Chunk]:
        for model in some:
            runs = tuple((cell * models + model, start, end) for cell, start, end in batches[turn])
            yield Chunk(f"part-{turn:03d}-{model:06d}", runs)

    def run(turn: int, some: Sequence[int]) -> None:
        for done in executor.run(study, parts, list(chunks(turn, some))):
            if done.content:  # a chunk that was cut, as its process died
                parts.write(done.name, done.content)
            key = turn, int(done.name.rpartition("-")[2])
            turn_times.cpu_s[key], turn_times.runs[key] = done.cpu_s, done.runs

    left: Sequence[int] = after(done) if done else range(models)
    if done == len(batches):
        return
    # What a process does once, imports and compiled code, is nobody's time: all run one run first.
    cell, start, _ = batches[0][0]
    warm = [
        Chunk(f"part-000-{k:06d}", ((cell * models, start, start + 1),), whole=False)
        for k in range(workers)
    ]
    for _ in executor.run(study, parts, warm):
        pass
    for turn in range(done, len(batches)):
        if turn == 0:
            run(0, [0])
            begun(turn_times.cpu_s[0, 0])
            run(0, left[1:])
        else:  # nobody is always the first, who makes what all of a turn share
            first = turn % len(left)
            run(turn, [*left[first:], *left[:first]])
        left = after(turn + 1)
