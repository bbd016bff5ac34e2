"""When blocks of a scene are out, which follows from scene and seed: nothing is recorded of it.

A block is out while an outage of it lasts (``[[outages]]``), and while a change has it switched off
(``enabled = false`` in ``[[changes]]``).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.drawn_columns import replica_scenes
from dsa_des.scene.changes import TimedChange
from dsa_des.scene.scene import Scene
from dsa_des.stretches.outages import Outages, merge_spans
from dsa_des.time.randomness import Streams
from dsa_des.time.timeline_runs import Runs

#: By block, of every run: from and to, s, (spans, 2), in order.
TimesOut = Mapping[str, list[FloatArray]]

_ENABLED = "enabled"


def blocks_with_outages(scene: Scene) -> list[str]:
    """Return, sorted, the blocks that fail at random or that changes switch on or off."""
    names = {name for one in scene.outages for name in one.blocks}
    return sorted(names.union(*(map(_switched_blocks, scene.changes))))


def outage_times_of_seeds(scene: Scene, seeds: Sequence[int], ends_s: FloatArray) -> TimesOut:
    """Return block → per run the (from, to) outage times, s, as an array (spans, 2).

    Runs differ in seeds and in when they end.
    """
    per_s = scene.ticks_per_s
    ends = np.rint(np.asarray(ends_s) * per_s).astype(np.int64)
    runs = Runs(len(seeds), int(ends.max(initial=0)))
    runs.ends = ends
    starts = [0, *(int(stretch.from_s * per_s) for stretch in scene.stretches), runs.run_ticks]
    scenes = [scene, *(stretch.scene for stretch in scene.stretches)]
    result: dict[str, list[FloatArray]] = {}
    for name in blocks_with_outages(scene):
        failing = [one for one in scene.outages if name in one.blocks]
        drawn = Outages(failing, Streams(seeds), runs, per_s) if failing else None
        off = np.array(
            [
                starts[number : number + 2]
                for number, one in enumerate(scenes)
                if not getattr(one.blocks[name].parameters, _ENABLED, True)
            ],
            dtype=np.int64,
        ).reshape(-1, 2)
        result[name] = []
        for run, end in enumerate(ends.tolist()):
            parts = [off] if drawn is None else [off, drawn.outage_spans(run)]
            result[name].append(merge_spans(np.concatenate(parts), end) / per_s)
    return result


def outage_times_of_replicas(
    scene: Scene, replicas: Sequence[Replica], ends_s: FloatArray
) -> TimesOut:
    """Return block → per replica the (from, to) outage times, s, as an array (spans, 2)."""
    seeds = [replica.seed for replica in replicas]
    if not any(key.endswith(".enabled") for one in replicas for key in one.changes):
        return outage_times_of_seeds(scene, seeds, ends_s)
    each = [
        outage_times_of_seeds(one, [seed], ends_s[[number]])
        for number, (one, seed) in enumerate(
            zip(replica_scenes(scene, replicas), seeds, strict=True)
        )
    ]
    return {name: [one[name][0] for one in each] for name in blocks_with_outages(scene)}


def _switched_blocks(change: TimedChange) -> set[str]:
    """Return the names of the blocks that a change switches on or off."""
    blocks = (key for key in change.keys if key[0] == "blocks")
    return {str(key[1]) for key in blocks if key[2:] == (_ENABLED,)}


def was_out_between(
    out: TimesOut, blocks: Sequence[str], from_s: FloatArray, to_s: FloatArray
) -> BoolArray:
    """Return a mask (replicas, n): whether any of the blocks was out in `from_s` to `to_s`.

    Instants are NaN where there are none, and nothing is out then.
    """
    result = np.zeros(from_s.shape, dtype=bool)
    for name in blocks:
        for run, spans in enumerate(out[name]):
            for first_s, last_s in spans.tolist():
                result[run] |= (first_s < to_s[run]) & (last_s > from_s[run])
    return result
