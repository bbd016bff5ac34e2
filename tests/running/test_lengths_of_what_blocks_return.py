"""What a stranger's block returns has one value for each row, entry or cell, or the run ends.

The blocks here stand in for shipped ones in a whole chain; `wrong` says which array is too long.
"""

import sys
from copy import copy
from pathlib import Path

import numpy as np
import pytest
from wired import HEARS_ALL, chain

import dsa_des
from components.fusion.pick_best import PickBest
from components.messages.targets import TrafficStates
from components.radar.threshold_radar import ThresholdRadar
from components.sensor import Look
from components.tracking.stub import TrackerStub
from components.traffic.scripted import ScriptedTraffic
from dsa_des.errors import BlockFailure
from dsa_des.running.simulation import Simulation

HERE = "test_lengths_of_what_blocks_return"
BLOCKS = {
    "traffic": ScriptedTraffic, "radar": ThresholdRadar, "fusion": PickBest, "tracker": TrackerStub,
}  # fmt: skip


@pytest.fixture(autouse=True)
def findable(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


class Looking(ThresholdRadar):
    """A radar whose look gives what `gives` makes of the cells and the right look."""

    gives = None

    def look(self, cells):
        return type(self).gives(cells, super().look(cells))


LOOKS = {
    "detected": lambda c, look: Look(look.detected[:1], look.confidence),
    "confidence": lambda c, look: Look(look.detected, np.append(look.confidence, 0.0)),
    "extras": lambda c, look: Look(look.detected, look.confidence, {"x": np.zeros(len(c) + 1)}),
    "noise": lambda c, look: Look(look.detected, look.confidence, noise=look.detected[:0]),
    "tail": lambda c, look: Look(look.detected, look.confidence, tail=np.ones(len(c) + 1)),
    "text": lambda c, look: Look(look.detected, look.confidence, tail=np.full(len(c), "x")),
    "signal": lambda c, look: Look(look.detected, look.confidence, signal={"x": 1j * c.range_m}),
    "counts": lambda c, look: Look(look.detected, look.confidence, noise=np.zeros(len(c), int)),
    "a list": lambda c, look: Look(list(look.detected), look.confidence),
    "two axes": lambda c, look: Look(look.detected[:, np.newaxis], look.confidence),
    "indices": lambda c, look: Look(np.arange(len(c)), look.confidence),
    "nothing": lambda c, look: None,
}  # fmt: skip


def run(block, stranger, window=None):
    scene = chain({"radar": {**HEARS_ALL, "scan_rate_hz": 4}}, fusion={"type": "fusion.pick_best"},
                  tracker={"type": "tracking.stub"}, duration_s=1)  # fmt: skip
    module = sys.modules.setdefault(HERE, sys.modules[__name__])
    module.Stranger = stranger
    stranger.__qualname__, stranger.__module__ = "Stranger", HERE
    scene["blocks"][block]["type"] = stranger
    Simulation(dsa_des.load_scene(scene), window=window).run()


@pytest.mark.parametrize("window", [None, 1])
@pytest.mark.parametrize("wrong", LOOKS)
def test_a_look_gives_one_value_for_each_cell(wrong, window):
    stranger = type("Stranger", (Looking,), {"gives": staticmethod(LOOKS[wrong])})
    said = {
        "indices": "int64: bool", "counts": "noise of int64: bool", "text": "tail of <U1: numbers",
        "signal": "x of complex128: numbers", "nothing": "NoneType",
    }.get(wrong, r"an array of \d+ cells")  # fmt: skip
    with pytest.raises(BlockFailure, match=rf"radar \({HERE}:Stranger\).*look gave .*{said}"):
        run("radar", stranger, window)


def longer(values):
    return np.concatenate([values, values[-1:], values[-1:]]) if len(values) else np.zeros(2)


def shortened(values):
    return values[:-1] if len(values) else longer(values)


#: Block, field of its message, and what becomes of it.
FIELDS = [
    ("traffic", "own_lat_deg", longer), ("traffic", "present", shortened),
    ("radar", "azimuth_rad", longer), ("radar", "scan", shortened), ("radar", "offsets", longer),
    ("radar", "skipped", list), ("fusion", "true_range_m", longer), ("fusion", "target", shortened),
    ("tracker", "age_s", longer), ("tracker", "updated", longer),
    ("tracker", "range_m", lambda v: v.astype(object)),
]  # fmt: skip


@pytest.mark.parametrize("window", [None, 1])
@pytest.mark.parametrize("block, name, change", FIELDS)
def test_a_message_has_one_value_for_each_row_or_entry(block, name, change, window):
    class Stranger(BLOCKS[block]):
        def run(self, wake):
            message = copy(super().run(wake))
            setattr(message, name, change(getattr(message, name)))
            return message

    with pytest.raises(BlockFailure, match=rf"{block} \({HERE}:Stranger\).*\.{name}") as failed:
        run(block, Stranger, window)
    assert (
        "rows" in str(failed.value)
        or "entries" in str(failed.value)
        or "numbers" in str(failed.value)
    )


def test_states_have_a_column_for_each_target():
    class Stranger(ScriptedTraffic):
        def run(self, wake):
            message = super().run(wake)
            return TrafficStates(**{**vars(message), "lat_deg": message.lat_deg[:, :1]})

    with pytest.raises(BlockFailure, match=r"TrafficStates\.lat_deg.*\(\d+, 1\).*2 targets"):
        run("traffic", Stranger)
