"""A checked study: cells, replicas, and the order in which they are run.

A *cell* is one combination of axis values; its replicas differ by seed and random draws. Runs are
numbered cell by cell and cut into chunks whose size knows nothing of workers, so that what a chunk
gives never depends on the worker.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dsa_des.block.foreign_calls import ForeignFailure, wrap_foreign_errors
from dsa_des.block.registry import with_source_folder
from dsa_des.block.source_file import absolute_type_name
from dsa_des.replicas.changed_scene import Replica
from dsa_des.results.record import FigureRecord, Requirement, StopWhen
from dsa_des.scene.overrides import SWAP, apply_changes, read_sets
from dsa_des.scene.scene import Scene, check_scene
from dsa_des.scene.scene_file import SceneFile
from dsa_des.studies.allocation import Allocation, round_ends
from dsa_des.studies.axes import Axis
from dsa_des.studies.draws import Draw, member_seed, replica_seed
from dsa_des.studies.metric import Metric, check_tables_recordable, find_metric
from dsa_des.studies.splitting import SplitEvent, Splitting
from dsa_des.studies.study_tables import existing_file
from dsa_des.text.run_commands import format_set_option_value, shell_command_of_run
from dsa_des.text.safe_text import shell_line
from dsa_des.time.randomness import key_of


@dataclass(frozen=True)
class MetricSpec:
    """A metric as a study file gives it: its registered name and the values of its own keys."""

    name: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    #: Its position in the study's list, for messages.
    index: int = 0
    #: The event that splitting is for, of which repetitions then tell; none of a plain study.
    splits: str = ""

    def build(self, scene: Scene) -> Metric:
        """Return the metric, built for a scene; ValueError if that fails."""
        cls = find_metric(self.name, (scene.path.parent,))
        try:
            with wrap_foreign_errors(ValueError):
                check_tables_recordable(cls, scene)
                metric = cls(cls.Parameters.model_validate(dict(self.keys)), scene)
                return SplitEvent(metric, self.splits) if self.splits else metric
        except ForeignFailure as error:
            raise ValueError(f"metric {self.name} cannot be made: {error}") from error.__cause__


#: For the sake of all ratios.
AUTO = "auto"


@dataclass(frozen=True)
class Chunk:
    """Some consecutive runs of a study: for each cell in it, a range of replicas."""

    name: str
    runs: tuple[tuple[int, int, int], ...]
    #: Of cells of which a sample of the runs is flown.
    plans: Mapping[int, Allocation] = field(default_factory=dict)
    #: Whether these are all runs of its part; a piece is put together with the others.
    whole: bool = True

    def __len__(self) -> int:
        return sum(end - start for _, start, end in self.runs)

    @property
    def expected_flown(self) -> float:
        """Expected number of the chunk's runs that are flown."""
        return sum(
            (end - start) * (self.plans[cell].share if cell in self.plans else 1.0)
            for cell, start, end in self.runs
        )


@dataclass
class Study:
    """A study that has been read and checked, so that it can be run."""

    path: Path
    scene_path: Path
    title: str
    seed: int
    #: Per cell; with `stop_when` the most.
    replicas: int
    axes: tuple[Axis, ...]
    draws: tuple[Draw, ...]
    metrics: tuple[MetricSpec, ...]
    #: Set in every cell.
    sets: tuple[tuple[str, Any], ...]
    #: Made in every cell.
    swaps: tuple[tuple[str, str], ...]
    #: Columns of axes that are a sample (of encounters): statistics are taken over them, and each
    #: member has seeds and draws of its own.
    over: tuple[str, ...]
    #: With which value of which axis the others are compared.
    baseline: tuple[str, Any] | None
    stop_when: StopWhen | None
    confidence: float
    interval: str
    figures: tuple[FigureRecord, ...]
    runs_per_chunk: int
    #: The scene's tables.
    base: SceneFile
    #: The study's own tables, with paths that do not depend on where it stands.
    tables: dict[str, Any]
    requirements: tuple[Requirement, ...] = ()
    #: The result that weighs units where events are compared.
    compare_weight: str | None = None
    #: Names of the ratios for whose sake a sample of the runs is flown, or `AUTO`; none: all are.
    allocate: tuple[str, ...] = ()
    #: Where replicas are repetitions of splitting.
    splitting: Splitting | None = None
    #: The command line that runs it again, whatever was changed of its file.
    repeat: str = ""

    @property
    def _axis_lengths(self) -> tuple[int, ...]:
        return tuple(len(axis.labels) for axis in self.axes)

    @property
    def cells(self) -> range:
        """The numbers of all cells."""
        return range(math.prod(self._axis_lengths))

    def axis_value_indices(self, cell: int) -> tuple[int, ...]:
        """Return the index of each axis's value in a cell; the last axis varies fastest."""
        return tuple(map(int, np.unravel_index(cell, self._axis_lengths)))

    def cell_at(self, indices: Sequence[int]) -> int:
        """Return the number of the cell with these axis value indices."""
        return int(np.ravel_multi_index(tuple(indices), self._axis_lengths)) if indices else 0

    @property
    def runs_started_per_cell(self) -> int:
        """Runs started per cell: replicas, times the runs of one stage if there is splitting."""
        return self.replicas * (1 if self.splitting is None else self.splitting.runs)

    @property
    def replicas_per_batch(self) -> int:
        """Replicas of a cell between two checks of the stop criterion; all replicas without one."""
        return self.stop_when.batch if self.stop_when else self.replicas

    @property
    def round_ends(self) -> list[int]:
        """The replica before which each round ends; results are checked between rounds."""
        if self.allocate:
            return round_ends(self.replicas, self.stop_when.batch if self.stop_when else None)
        return [
            min(n + self.replicas_per_batch, self.replicas)
            for n in range(0, self.replicas, self.replicas_per_batch)
        ]

    def labels(self, cell: int) -> dict[str, Any]:
        """Return column → label of every axis's value in a cell."""
        indices = self.axis_value_indices(cell)
        return {a.column: a.labels[i] for a, i in zip(self.axes, indices, strict=True)}

    def swaps_and_sets(self, cell: int) -> tuple[list[tuple[str, str]], list[tuple[str, Any]]]:
        """Return (swaps, set values) from base to cell scene, each as (name, value) pairs."""
        swaps, sets = list(self.swaps), list(self.sets)
        for axis, index in zip(self.axes, self.axis_value_indices(cell), strict=True):
            swaps += axis.swaps[index]
            sets += axis.sets[index]
        return swaps, sets

    def scene(self, cell: int) -> Scene:
        """Return the checked scene of a cell."""
        return changed_scene(self.base, *self.swaps_and_sets(cell), str(self.path))

    def member_seed(self, cell: int) -> int:
        """Return the seed of a cell's runs, by its values of sampled axes; else the study's."""
        if not self.over:
            return self.seed
        members = zip(self.axes, self.axis_value_indices(cell), strict=True)
        return member_seed(self.seed, ((a, i) for a, i in members if a.column in self.over))

    def replica(self, number: int, cell: int = 0) -> Replica:
        """Return the seed and the drawn values of a replica as a `Replica`.

        They are the same in all cells, or in all cells of the same encounter where the study runs
        over a sample (`over`).
        """
        seed = self.member_seed(cell)
        return Replica(
            replica_seed(seed, number),
            {draw.key: draw.value(seed, number, self.replicas_per_batch) for draw in self.draws},
        )

    def first_runs_of_repetition(self, number: int, cell: int) -> tuple[list[Replica], int]:
        """Return the first runs of a repetition of splitting, and the seed of its branches.

        Each of the runs is one of a plain study. Number -1 is the pilot, which has draws of its
        own.
        """
        assert self.splitting is not None
        seed, runs = key_of(self.member_seed(cell), "study splitting", number), self.splitting.runs
        if number >= 0:
            return [self.replica(number * runs + k, cell) for k in range(runs)], seed
        return [
            Replica(replica_seed(seed, k), {d.key: d.value(seed, k, runs) for d in self.draws})
            for k in range(runs)
        ], seed

    def command(self, cell: int, number: int) -> str:
        """Return the command that runs one replica of a cell again."""
        swaps, sets = self.swaps_and_sets(cell)
        replica = self.replica(number, cell)
        changes = [
            (key, format_set_value(value)) for key, value in [*sets, *replica.changes.items()]
        ]
        return shell_command_of_run(str(self.scene_path), replica.seed, swaps, changes)

    def chunks(
        self, round_number: int, cells: Sequence[int], plans: Mapping[int, Allocation] | None = None
    ) -> Iterator[Chunk]:
        """Yield one round's chunks, which hold a batch of replicas of each given cell.

        Of each chunk `runs_per_chunk` are flown, as many as a plan leads to expect.
        """
        start, end = [0, *self.round_ends][round_number : round_number + 2]
        plans = plans or {}
        runs: list[tuple[int, int, int]] = []
        room, number = float(self.runs_per_chunk), 0
        for cell in cells:
            share = plans[cell].share if cell in plans else 1.0
            first = start
            while first < end:
                last = min(end, first + math.ceil(room / share))
                runs.append((cell, first, last))
                room -= (last - first) * share
                first = last
                if room <= 0.0:
                    yield Chunk(f"part-{round_number:03d}-{number:06d}", tuple(runs), plans)
                    runs, room, number = [], float(self.runs_per_chunk), number + 1
        if runs:
            yield Chunk(f"part-{round_number:03d}-{number:06d}", tuple(runs), plans)


def format_set_value(value: Any) -> str:
    """Return a value as text for ``--set``; a file named from its own folder becomes its path."""
    folder = getattr(value, "folder", None)
    if folder is not None and (path := existing_file(value, folder)) is not None:
        return str(path)
    if isinstance(value, list | dict):
        from dsa_des.files.toml_files import inline_toml

        return inline_toml(value)
    return format_set_option_value(value)


def portable_command_line(words: Iterable[str], sets: Iterable[str], *paths: Path) -> str:
    """Return the ``dsa-des`` command with these words, ``--set`` and paths, for any folder."""
    every = ["dsa-des", *words]
    for key, value in read_sets(sets)[0]:
        every += [
            "--set",
            f"{key}={format_set_value(absolute_type_name(value) if SWAP in key else value)}",
        ]
    return shell_line([*every, *(str(path.resolve()) for path in paths)])


def changed_scene(
    base: SceneFile,
    swaps: Sequence[tuple[str, str]],
    sets: Sequence[tuple[str, Any]],
    source: str,
) -> Scene:
    """Return the checked scene of a copy of the base tables with swaps and set values applied."""
    file, folder = base.copy(), Path(source).parent
    types = [(SWAP + block, with_source_folder(name, folder)) for block, name in swaps]
    apply_changes(file, [*types, *sets], source, source, "swap")
    return check_scene(file)
