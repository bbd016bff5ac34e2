"""Scenes of small test blocks, written to a temporary folder and run."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

_NAME = "engine_blocks"
CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def write_scene(folder, blocks, wires, *, duration_s=1, seed=3, name="scene.toml"):
    """Write a scene; each block is TOML text for its table, types of ours without a module."""
    lines = [f"duration_s = {duration_s}", f"seed = {seed}"]
    lines.append("wires = [" + ", ".join(wires) + "]")
    for block, text in blocks.items():
        kind, _, rest = text.partition(";")
        kind = kind.strip()
        kind = f"{_NAME}:{kind}" if kind[0].isupper() else kind
        parameters = [part.strip() for part in rest.split(";") if part.strip()]
        lines += ["", f"[blocks.{block}]", f'type = "{kind}"', *parameters]
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


class _Noting:
    """Notes when a block runs, also in windows that are undone later."""

    def __init__(self, name, runner, trace):
        self.name, self.runner, self.trace = name, runner, trace

    def run(self, wake):
        self.trace += [(tick, self.name) for tick in wake.ticks.tolist()]
        return self.runner.run(wake)


def run_scene(path, *, window=None, shuffle_ties=None, record=True, sinks=(), **load):
    """Run a scene; return its trace, Arrow tables, outcome and simulation."""
    memory = MemorySink()
    trace = []
    simulation = Simulation(
        load_scene(path, **load),
        window=window,
        shuffle_ties=shuffle_ties,
        recorder=Recorder([memory, *sinks]) if record else None,
    )
    for node in simulation.nodes.values():
        node.runner = _Noting(node.name, node.runner, trace)
    outcome = simulation.run()
    tables = memory.tables() if record else {}
    return SimpleNamespace(trace=trace, tables=tables, outcome=outcome, simulation=simulation)


def rows_of(tables, block, table="beats"):
    """Return the recorded rows of one block as dictionaries."""
    return [row for row in tables[table].to_pylist() if row["block"] == block]


def problems_of(path, **load):
    """Return the problems of a scene that must not load."""
    with pytest.raises(SceneError) as caught:
        Simulation(load_scene(path, **load))
    return caught.value.problems


def lab_in(tmp_path):
    """Return everything above, with a folder to write in."""
    return SimpleNamespace(
        folder=tmp_path,
        configs=CONFIGS,
        write=lambda *args, **kwargs: write_scene(tmp_path, *args, **kwargs),
        run=run_scene,
        rows=rows_of,
        problems=problems_of,
    )
