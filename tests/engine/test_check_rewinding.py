"""The debug switch that runs every window twice finds state that does not come back."""

import engine_blocks as blocks
import numpy as np
import pytest
from click.testing import CliRunner
from engine_blocks import Cued, Pulse, Relay, beat

from dsa_des.block.effect import Effect, Verdict
from dsa_des.cli import main
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

LOOP = [
    '"src -> cue.in"',
    '"cue -> end"',
    '{ from = "end", to = "cue.cue", delay = "1 scan", holds = "nothing" }',
]
COUNT = [0]


class Source(Pulse):
    rewindable = True


class Looped(Cued):
    rewindable = True


class End(Relay):
    """Keeps its promise: all of its state are its attributes."""

    rewindable = True

    def __init__(self, *args):
        super().__init__(*args)
        self.rows, self.seen, self.table = 0, [], {}

    def value(self, wake, message):
        places = self.rows + np.arange(len(message))
        self.rows += len(message)
        self.seen.extend(places.tolist())  # in place, of a list that is an attribute: allowed
        self.table = {**self.table, self.rows: [message.scan.tolist()]}
        return message.value + places

    def run(self, wake):
        message = wake["in"]
        if message is None:
            return None
        return beat(wake.ticks, self.value(wake, message), message.scan)


class ModuleGlobal(End):
    def value(self, wake, message):
        COUNT[0] += 1
        return message.value + COUNT[0]


class Nested(End):
    """Says nothing of what it remembers: only its memory differs."""

    def __init__(self, *args):
        super().__init__(*args)
        self.memory = {"scans": []}

    def value(self, wake, message):
        self.memory["scans"].append(int(message.scan[0]))
        return message.value


class FirstTime(End):
    """Does something else only the first time that it meets a scan."""

    def __init__(self, *args):
        super().__init__(*args)
        self.met = (set(),)

    def value(self, wake, message):
        new = [scan not in self.met[0] for scan in message.scan.tolist()]
        self.met[0].update(message.scan.tolist())
        return message.value + np.array(new)


class Generator(End):
    def __init__(self, *args):
        super().__init__(*args)
        self.random = np.random.default_rng(1)

    def value(self, wake, message):
        return message.value + self.random.uniform(size=len(message))


class Unsteady(Effect):
    """Builds a function that counts its calls where nothing can take it back."""

    name = "unsteady"
    acts_on = "value"

    def verdict(self, block):
        return Verdict(True, "it always is")

    def build(self, block):
        calls = []

        def counted(value):
            calls.append(1)
            return value

        return counted


class WithEffect(End):
    hooks = {"value": "(value) -> value"}
    effects = (Unsteady(),)

    def value(self, wake, message):
        (counted,) = self.built("value")
        return counted(message.value)


class Second(End):
    """Fails when it meets a scan again."""

    def __init__(self, *args):
        super().__init__(*args)
        self.met = (set(),)

    def value(self, wake, message):
        if self.met[0] & set(message.scan.tolist()):
            raise RuntimeError("been there")
        self.met[0].update(message.scan.tolist())
        return message.value


def loop(lab, monkeypatch, kind, wires=LOOP):
    for cls in (Source, Looped, kind):
        monkeypatch.setattr(blocks, cls.__name__, cls, raising=False)
    cells = {
        "src": "Source; scan_rate_hz = 20",
        "cue": "Looped; scan_rate_hz = 10",
        "end": kind.__name__,
    }
    return lab.write(cells, wires, duration_s=4)


def recorded(path, **options):
    sink = ColumnSink()
    simulation = Simulation(load_scene(path), recorder=Recorder([sink]), **options)
    simulation.run()
    return simulation, sink.tables()["beats"]


@pytest.mark.parametrize("wires", [LOOP, LOOP[:2]])
def test_blocks_that_keep_their_promise_record_the_same(lab, monkeypatch, wires):
    path = loop(lab, monkeypatch, End, wires)
    _, plain = recorded(path, window=4)
    simulation, twice = recorded(path, window=4, check_rewinding=True)
    assert simulation.windows.witness.windows > 1
    for name in ("tick", "value", "seen"):
        assert plain[name].tobytes() == twice[name].tobytes()


@pytest.mark.parametrize(
    ("kind", "what"),
    [
        (ModuleGlobal, "sends something else (output out, field value)"),
        (Generator, "sends something else (output out, field value)"),
        (FirstTime, "sends something else (output out, field value)"),
        (Nested, "remembers something else (attribute memory)"),
        (WithEffect, "remembers something else (effect unsteady)"),
        (Second, "fails the second time (RuntimeError: been there)"),
    ],
)
def test_state_that_does_not_come_back_names_the_block(lab, monkeypatch, kind, what):
    path = loop(lab, monkeypatch, kind, LOOP[:2])
    Simulation(load_scene(path)).run()  # nothing is said without the switch
    with pytest.raises(BlockFailure) as caught:
        recorded(path, check_rewinding=True)
    said = str(caught.value)
    # Not the blocks behind it, which send something else in consequence.
    assert said.startswith("end (") and kind.__name__ in said
    assert what in said and "rewindable = True" in said


def test_the_command_runs_windows_twice(lab, monkeypatch):
    monkeypatch.chdir(lab.folder)
    for kind, code in ((End, 0), (ModuleGlobal, 1)):
        path = loop(lab, monkeypatch, kind)
        result = CliRunner().invoke(main, ["run", str(path), "--check-rewinding"])
        assert result.exit_code == code, result.output
        said = result.output
        assert ("came out the same" in said) == (code == 0)
        assert ("end (" in said and "rewound" in said) == (code == 1)


def test_what_cannot_be_rewound_cannot_be_checked(lab):
    path = lab.write({"src": "Pulse; scan_rate_hz = 2", "end": "SlowRelay"}, ['"src -> end"'])
    with pytest.raises(SceneError) as caught:
        Simulation(load_scene(path), check_rewinding=True)
    first, second = caught.value.problems
    assert first.key == "blocks.end.type" and "windowed is False" in first.message
    assert second.key == "blocks.src.type" and "rewindable is False" in second.message


def test_check_says_which_block_slows_a_loop(lab, monkeypatch):
    slow = type("Remembering", (End,), {"rewindable": False})
    said = CliRunner().invoke(main, ["check", str(loop(lab, monkeypatch, slow))]).output
    assert "feedback loop of cue, end runs scan by scan" in said
    assert "end (" in said and "rewindable is False" in said
    said = CliRunner().invoke(main, ["check", str(loop(lab, monkeypatch, End))]).output
    assert "note" not in said
    said = CliRunner().invoke(main, ["check", str(loop(lab, monkeypatch, slow, LOOP[:2]))]).output
    assert "note" not in said  # there is no loop to slow
