"""A small chain of two cameras and a radar, to see what an effect does to a run."""

from types import SimpleNamespace

import pytest

from dsa_des.record.recording import Recorder
from dsa_des.record.run_folder import join_row_columns
from dsa_des.record.sinks import MemorySink
from dsa_des.record.table_metadata import metadata_of_run
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """
duration_s = {duration}
seed = 3
wires = [
  "traffic -> transform -> gate", "gate -> eo", "gate -> ir", "gate -> radar",
]
{tables}
[blocks.transform]
type = "geometry.ellipsoid"

[blocks.gate]
type = "gate"

[blocks.eo]
extends = "{configs}/sensors/afrl_eo.toml"
scan_rate_hz = 10
{eo}

[blocks.ir]
extends = "{configs}/sensors/midas_ir.toml"
scan_rate_hz = 4
offset_s = 0.05
{ir}

[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 5
range_km = 8
{radar}

[blocks.traffic]
type = "traffic.scripted"
ownship = {{ {ownship} }}
"""
OWNSHIP = "lat_deg = 52.0, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, speed_mps = 50"
ENGINES = ("propeller", "turbofan", "turbojet")
INTRUDER = """
[[blocks.traffic.intruders]]
name = "{name}"
engine = "{engine}"
east_m = {east_m}
north_m = 1200
up_m = 40
heading_deg = {heading_deg}
speed_mps = 60
"""


@pytest.fixture
def scene(configs, tmp_path):
    """Write a scene with the given keys and three intruders, named by their usual engines."""

    def write(eo="", ir="", radar="", *, duration=20, tables="", ownship=OWNSHIP, engines=ENGINES):
        text = SCENE.format(
            configs=configs.as_posix(),
            duration=duration,
            eo=eo,
            ir=ir,
            radar=radar,
            tables=tables,
            ownship=ownship,
        )
        for i, engine in enumerate(engines):
            text += INTRUDER.format(
                name=ENGINES[i], engine=engine, east_m=700 * i - 900, heading_deg=20 + 30 * i
            )
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


class Made(SimpleNamespace):
    """What a run made; `made["detections"]` has the ownship's pose, as a `Run` has it."""

    def __getitem__(self, table):
        return join_row_columns(self.tables, table)


class Runs:
    """Run scenes and look at what was recorded."""

    @staticmethod
    def run(path, **options):
        memory = MemorySink()
        simulation = Simulation(load_scene(path), recorder=Recorder([memory]), **options)
        outcome = simulation.run()
        notes = metadata_of_run(simulation.recorded_message_types(), "", 1, simulation.ticks_per_s)
        return Made(
            tables=notes.tables_with_metadata(memory.tables()), plan=simulation.plan,
            simulation=simulation,
            outcome=outcome,
        )  # fmt: skip

    @staticmethod
    def detections(run, block):
        rows = [row for row in run["detections"].to_pylist() if row["block"] == block]
        return {(row["scan"], row["target"]): row for row in rows}

    @staticmethod
    def sentences(path, block):
        plan = Simulation(load_scene(path)).plan
        return {item.effect.name: item.sentence() for item in plan if item.block == block}


@pytest.fixture(scope="session")
def runs():
    return Runs()
