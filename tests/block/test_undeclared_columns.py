"""What a message holds and nobody declared is an error that says so; nothing is dropped."""

from dataclasses import dataclass

import engine_blocks as blocks
import numpy as np
import pytest
from engine_blocks import Beat, Pulse

from components.messages.detections import EXTRAS, Detections
from components.radar.threshold_radar import ThresholdRadar
from components.sensor.look import Look
from dsa_des.block.component import Output
from dsa_des.block.message import Column, columns
from dsa_des.errors import BlockFailure
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene


@dataclass(eq=False)
class Typo(Beat):
    """Records a column with a slip in its name."""

    def tables(self):
        return {"beats": {"tick": self.tick, "valeu": self.value}}


@dataclass(eq=False)
class Elsewhere(Beat):
    """Records a table that nobody declared."""

    def tables(self):
        return {**super().tables(), "beets": {"tick": self.tick}}


@dataclass(eq=False)
class Timeless(Beat):
    """Records a table without instants."""

    def tables(self):
        return {"beats": {"value": self.value}}


def pulse_of(kind):
    def run(self, wake):
        message = Pulse.run(self, wake)
        return kind(message.tick, message.value, message.scan, message.seen)

    return type(f"{kind.__name__}Pulse", (Pulse,), {"run": run})


def failure_of(lab, kind, monkeypatch, **options):
    monkeypatch.setattr(blocks, "Odd", pulse_of(kind), raising=False)
    path = lab.write({"a": "Odd; scan_rate_hz = 4", "b": "Relay"}, ['"a -> b"'])
    with pytest.raises(BlockFailure) as caught:
        lab.run(path, **options)
    return str(caught.value)


@pytest.mark.parametrize("window", [1, None])
def test_an_undeclared_column_names_block_column_and_what_is_declared(lab, monkeypatch, window):
    said = failure_of(lab, Typo, monkeypatch, window=window)
    assert "block 'a'" in said and "'valeu'" in said and "'beats'" in said
    assert "did you mean 'value'?" in said and "(declared: scan, seen, value)" in said


def test_an_undeclared_table_names_the_nearest(lab, monkeypatch):
    said = failure_of(lab, Elsewhere, monkeypatch)
    assert "block 'a'" in said and "'beets'" in said and "did you mean 'beats'?" in said


def test_a_table_without_instants_is_refused(lab, monkeypatch):
    assert "without a column 'tick'" in failure_of(lab, Timeless, monkeypatch)


@dataclass(eq=False)
class LaterTypo(Beat):
    """Records a column with a slip in its name, from the third instant on."""

    def tables(self):
        late = self.tick[-1] >= 500_000_000
        return {"beats": {"tick": self.tick, "valeu" if late else "value": self.value}}


def test_what_is_undeclared_later_on_only_names_its_block_and_instant_too(lab, monkeypatch):
    said = failure_of(lab, LaterTypo, monkeypatch, window=1)
    assert "block 'a'" in said and "'valeu'" in said and "t = 0.500 s" in said


def test_columns_are_looked_up_once_for_a_block_and_its_names():
    recorder = Recorder([ColumnSink()])
    recorder.open([Beat], 10)
    looked = []

    class Counting(dict):
        def get(self, *key):
            looked.append(key)
            return super().get(*key)

    recorder._declared._columns = Counting(recorder._declared._columns)
    for tick in range(5):
        recorder.record("a", blocks.beat(np.array([tick]), [1.0]))
        recorder.record("b", blocks.beat(np.array([tick]), [1.0]))
    assert len(looked) == 2


class CloudyRadar(ThresholdRadar):
    """Says of each cell what nobody declared."""

    def look(self, cells):
        look = super().look(cells)
        clouds = np.full(len(cells), 0.5)
        return Look(look.detected, look.confidence, {**look.extras, "cloud_share": clouds})


@dataclass(eq=False)
class CloudyDetections(Detections):
    """Detections with a column of their own."""

    extras: dict = columns(
        {**EXTRAS, "cloud_share": Column("", "", "of the cell")},
        value=lambda message: message.extra_columns(),
    )


class DeclaredCloudyRadar(CloudyRadar):
    """The same radar, which declares what it says."""

    outputs = {"detections": Output(CloudyDetections, "What was detected, and in which clouds.")}


def run_swapped(lab, monkeypatch, cls):
    monkeypatch.setattr(blocks, "Swapped", cls, raising=False)
    swaps = ("radar=engine_blocks:Swapped",)
    near = ("blocks.traffic.intruders[0].north_m=3000",)  # detected at once
    scene = load_scene(lab.configs / "first_light.toml", swaps=swaps, sets=near, duration_s=5)
    sink = ColumnSink()
    Simulation(scene, recorder=Recorder([sink])).run()
    return sink.tables()


def test_an_extra_of_a_look_that_nobody_declared_is_an_error(lab, monkeypatch):
    with pytest.raises(BlockFailure) as caught:
        run_swapped(lab, monkeypatch, CloudyRadar)
    said = str(caught.value)
    assert "block 'radar'" in said and "'cloud_share'" in said and "'detections'" in said
    assert "snr_db" in said


def test_an_extra_that_a_sensor_declares_is_recorded(lab, monkeypatch):
    columns = run_swapped(lab, monkeypatch, DeclaredCloudyRadar)["detections"]
    by_radar = columns["block"].codes == columns["block"].names.index("radar")
    assert by_radar.any() and (columns["cloud_share"][by_radar] == 0.5).all()
    assert np.isnan(columns["cloud_share"][~by_radar]).all()  # the others say nothing of clouds
