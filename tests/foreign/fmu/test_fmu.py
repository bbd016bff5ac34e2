"""FMUs of other people as blocks of a scene."""

import math
import os
import signal
import subprocess
import tempfile
import time
from contextlib import suppress
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from covering import covers

from components.foreign.fmu.message_columns import message_column
from components.foreign.signals import Signals
from dsa_des.errors import BlockFailure, SceneError, SetupFailure
from tests import warm_process
from tests.support.waiting import wait_for

FMU = ("foreign.fmu",)
_CHAIN = [
    "traffic -> transform -> gate",
    "gate -> radar", "gate -> eo", "gate -> ir",
    "radar -> fusion", "eo -> fusion", "ir -> fusion",
    "fusion -> tracker",
]  # fmt: skip


def _values(tables, block, signal, element=0):
    rows = tables["signals"].to_pylist()
    chosen = [
        r for r in rows if (r["block"], r["signal"], r["element"]) == (block, signal, element)
    ]
    return np.array([r["time_s"] for r in chosen]), np.array([r["value"] for r in chosen])


def _scene(lab, path, text, name="scene.toml", base="first_light.toml", wires=(), duration_s=20):
    """Write a shipped scene with blocks of our own beside it."""
    listed = ", ".join(w if w.startswith("{") else f'"{w}"' for w in (*_CHAIN, *wires))
    file = lab.folder / name
    file.write_text(
        f'extends = "{lab.configs / base}"\nduration_s = {duration_s}\nwires = [{listed}]\n'
        + text.replace("LAG", str(path)),
        encoding="utf-8",
    )
    return file


def _running_with(word):
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            found += [entry] if word.encode() in entry.read_bytes() else []
    return found


def _is_past_first_points(folder):
    with suppress(OSError):  # it is gone meanwhile
        for beat in folder.glob("dsa_des_fmu_*/beat"):
            return int.from_bytes(beat.read_bytes(), "little") > 5
    return False


def _left_behind():
    ours = {p.name for p in Path(tempfile.gettempdir()).glob("dsa_des_fmu_*")}
    running = set()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes()
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError):
            continue
        if b"running.worker" in words and parent == os.getpid():
            running.add(entry.name)
    return ours, running


@pytest.mark.parametrize("version", [2, 3])
@covers("file", "scan_rate_hz", "offset_s", "start", of=FMU)
def test_steps_are_those_of_the_closed_form(lab, lag, version):
    start = "u = [3, 1, 2], " if version == 3 else "u = 6, "
    scene = lab.write(
        {"lag": f'foreign.fmu; file = "{lag(version)}"; scan_rate_hz = "10/3"; offset_s = 0.5; '
                f'start = {{ {start}gain = 2, x = 1 }}'},
        [], duration_s=6,
    )  # fmt: skip
    time_s, x = _values(lab.run(scene).tables, "lag", "x")
    assert time_s == pytest.approx(0.5 + 0.3 * np.arange(19))
    assert x == pytest.approx(12 - 11 * np.exp(0.5 - time_s), rel=1e-12)


def test_it_returns_early_and_handles_its_events(lab, lag):
    text = 'foreign.fmu; file = "{}"; scan_rate_hz = 10; start = {{ u = [1, 1, 1], events = {} }}'
    plain, eventful = (
        lab.run(lab.write({"lag": text.format(lag(), events)}, [], duration_s=1.05)).tables
        for events in (0, 0.025)
    )
    _, steps = _values(eventful, "lag", "steps")
    assert steps[-1] == 40  # four to each communication point
    assert _values(eventful, "lag", "seen")[1][-1] == 1 + 30  # and one at the start
    assert _values(plain, "lag", "steps")[1][-1] == 10
    assert _values(eventful, "lag", "x")[1] == pytest.approx(_values(plain, "lag", "x")[1], 1e-12)


@covers("outputs", of=FMU)
def test_arrays_have_the_length_that_the_scene_says(lab, lag):
    scene = lab.write(
        {"lag": f'foreign.fmu; file = "{lag()}"; scan_rate_hz = 1; outputs = ["xu", "largest"]; '
                "start = { n = 2, u = [3, 4], x = 2 }"},
        [], duration_s=1,
    )  # fmt: skip
    rows = lab.run(scene).tables["signals"].to_pylist()
    assert [(r["signal"], r["element"], r["value"]) for r in rows[:2]] == [
        ("xu", 1, 6.0), ("xu", 2, 8.0)
    ]  # fmt: skip
    assert rows[2]["text"] == str(2**64 - 1)


@covers("inputs", of=FMU)
def test_windows_and_wires_change_nothing(lab, lag):
    scene = _scene(lab, lag(), """
[blocks.lag]
type = "foreign.fmu"
file = "LAG"
inputs = { "u[1]" = "traffic.own_alt_m", "u[2]" = "tracker.range_m[crossing]" }
[blocks.second]
type = "foreign.fmu"
file = "LAG"
scan_rate_hz = 7
inputs = { "u[3]" = "lag.x" }
""", wires=["traffic -> lag", "tracker -> lag", "lag -> second"], duration_s=6)  # fmt: skip
    whole = lab.run(scene).tables
    for window in (1, 13):
        for name, table in lab.run(scene, window=window).tables.items():
            assert table.equals(whole[name]), (name, window)
    tracks = [r for r in whole["tracks"].to_pylist() if r["target"] == "crossing"]
    xu = _values(whole, "lag", "xu", 2)
    x = _values(whole, "lag", "x")
    at = np.searchsorted(xu[0], tracks[-1]["time_s"])
    assert xu[1][at] == pytest.approx(x[1][at] * tracks[-1]["range_m"] / 0.3048)
    assert _values(whole, "lag", "xu", 1)[1] == pytest.approx(x[1] * 1000 / 0.3048)
    # The second one holds what the first said last.
    time_s, given = _values(whole, "second", "xu", 3)
    held = x[1][np.searchsorted(x[0], time_s, side="right") - 1]
    assert given == pytest.approx(held * _values(whole, "second", "x")[1])


_LOOP = """
[blocks.radar]
scan_rate_hz = 1
[blocks.eo]
scan_rate_hz = 1
[blocks.ir]
scan_rate_hz = 1
[blocks.pilot]
type = "foreign.fmu"
file = "LAG"
outputs = ["x"]
inputs = { "u[1]" = "tracker.range_m[crossing]" }
manoeuvre = { turn_rad = "turn", rate_rad_s = "turn_rate" }
"""
_BACK = '{ from = "pilot", to = "traffic", delay_s = 0.001, holds = "nothing" }'


@covers("manoeuvre", of=FMU)
def test_one_that_can_be_taken_back_looks_ahead_in_a_loop(lab, lag):
    wires = ["tracker -> pilot", _BACK]
    scene = _scene(lab, lag(), _LOOP, wires=wires, duration_s=110)
    ahead, by_scans = lab.run(scene), lab.run(scene, window=1)
    assert ahead.simulation.slow == {} and "pilot" in ahead.outcome.windowed
    for name, table in ahead.tables.items():
        assert table.equals(by_scans.tables[name]), name
    turn = [r["turn_rad"] for r in ahead.tables["manoeuvres"].to_pylist()]
    assert turn and turn[0] == 0.5


def test_one_that_cannot_says_so(lab, lag):
    path = lag(rewindable=False)
    scene = _scene(lab, path, _LOOP, wires=["tracker -> pilot", _BACK], duration_s=2)
    said = str(lab.run(scene).simulation.slow)
    assert "cannot" not in said and "not all blocks can be rewound: " in said and "pilot" in said


@covers("ownship", of=FMU)
def test_traffic_goes_on_with_the_ownship_where_the_fmu_flies_it(lab, lag):
    text = """
[blocks.dynamics]
type = "foreign.fmu"
file = "LAG"
start = { x = "500 m", u = ["500 m", 0, 0] }
ownship = { own_alt_m = "x" }
"""
    scene = _scene(lab, lag(), text)
    wired = scene.read_text("utf-8").replace("traffic ->", "traffic -> dynamics ->")
    (lab.folder / "flown.toml").write_text(wired, encoding="utf-8")
    flown = lab.run(lab.folder / "flown.toml").tables["detections"].to_pylist()
    low = lab.run(
        lab.configs / "first_light.toml",
        sets=("blocks.traffic.ownship.alt_m=500", "duration_s=20",
              "blocks.traffic.intruders[0].up_m=530", "blocks.traffic.intruders[1].up_m=650"),
    ).tables["detections"].to_pylist()  # fmt: skip
    radar = [
        [(r["tick"], r["target"], r["true_elevation_rad"]) for r in rows if r["block"] == "radar"]
        for rows in (flown, low)
    ]
    assert radar[0] and [r[:2] for r in radar[0]] == [r[:2] for r in radar[1]]
    assert [r[2] for r in radar[0]] == pytest.approx([r[2] for r in radar[1]], abs=1e-6)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (1, "at 0.6 s: fmi3DoStep returned Error: valve stuck"),
        (2, "did not answer within 100 s (deadline_s)"),
        (3, "died of signal 6 (SIGABRT); it printed: last words"),
        (4, "ended with exit code 0"),
    ],
)
@covers("deadline_s", of=FMU)
def test_one_clear_error_and_nothing_left(lab, lag, fault, said, monkeypatch):
    folder, clock = lab.folder / "of_this_test", time.monotonic
    folder.mkdir()  # others run beside it
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    if fault == 2:  # by this clock the deadline is over once it hangs, however fast the machine is
        looks = count()

        def late():  # 200 s from each look to the next
            return clock() + 200.0 * (next(looks) if _is_past_first_points(folder) else 0)

        monkeypatch.setattr(time, "monotonic", late)
    before = _left_behind()
    scene = lab.write(
        {"lag": f'foreign.fmu; file = "{lag()}"; scan_rate_hz = 10; deadline_s = 100; '
                f"start = {{ fault = {fault} }}"},
        [], duration_s=2,
    )  # fmt: skip
    with pytest.raises(BlockFailure) as caught:
        lab.run(scene)
    assert caught.value.exit_code == 3
    assert said in str(caught.value) and "\n" not in str(caught.value)
    assert ".py" not in str(caught.value)  # where it was noticed is of no use to anybody
    now = _left_behind()
    assert not now[0] and now[1] <= before[1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_nothing_is_left_when_we_are_interrupted_or_killed(lab, lag, number):
    scene = lab.write(
        {"lag": f'foreign.fmu; file = "{lag()}"; scan_rate_hz = 10; deadline_s = 60; '
                "start = { fault = 2 }"},
        [], duration_s=2,
    )  # fmt: skip
    folder = lab.folder / "temporary"
    folder.mkdir()
    out = lab.folder / "out"
    ours = warm_process.start(
        ["-m", "dsa_des", "run", scene, "--out", out],
        env={**os.environ, "TMPDIR": str(folder)}, stdout=subprocess.DEVNULL,
    )  # fmt: skip

    wait_for(lambda: _is_past_first_points(folder))  # and hangs
    os.kill(ours.pid, number)
    _, said = ours.communicate()
    assert ours.returncode == (-9 if number == signal.SIGKILL else 128 + number), said

    def gone():  # a process that was killed takes its time to go
        inside = [name for _, *kinds in os.walk(folder) for names in kinds for name in names]
        return not inside and not _running_with(str(folder))

    assert wait_for(gone) and not out.exists()


@pytest.mark.parametrize("version", [2, 3])
def test_where_nothing_goes_back_an_fmu_is_told_so(lab, lag, version):
    """Some do not move while their state might be set again to one before."""
    start = "u = [3, 1, 2], " if version == 3 else "u = 6, "
    for rewindable in (True, False):
        path = lag(version, rewindable=rewindable)
        scene = lab.write(
            {"lag": f'foreign.fmu; file = "{path}"; scan_rate_hz = 10; '
                    f'start = {{ {start}fault = 7 }}'},
            [], duration_s=2,
        )  # fmt: skip
        time_s, x = _values(lab.run(scene).tables, "lag", "x")
        assert x == pytest.approx(6 - 6 * np.exp(-time_s), rel=1e-12)


def test_in_a_loop_that_looks_ahead_an_fmu_is_told_that_it_may_go_back(lab, lag):
    text = _LOOP.replace("inputs = {", "start = { fault = 7 }\ninputs = {")
    for rewindable in (True, False):
        path = lag(rewindable=rewindable)
        scene = _scene(lab, path, text, wires=["tracker -> pilot", _BACK], duration_s=110)
        x = _values(lab.run(scene).tables, "pilot", "x")[1]
        assert (x == 0.0).all() == rewindable


def test_a_library_that_crashes_when_it_is_loaded_has_failed(lab, lag):
    path = lag(more="__attribute__((constructor)) static void die(void) { abort(); }\n")
    with pytest.raises(SetupFailure, match="died of signal 6") as caught:
        lab.run(lab.write({"b": f'foreign.fmu; file = "{path}"; scan_rate_hz = 1'}, []))
    assert caught.value.exit_code == 3


@pytest.mark.parametrize(
    ("version", "change", "said"),
    [
        (3, ('name="steps"', 'name="seen"'), "has 2 variables of the name 'seen'"),
        (2, ('name="gain"', 'name="u"'), "has 2 variables of the name 'u'"),
        (3, ('causality="input" start="0"', 'causality="input" start="NaN"'),
         "'u' starts at 'NaN', which is no number"),
        (3, ('initial="exact" start="0"', 'initial="exact" start="NaN"'),
         "'x' starts at 'NaN', which is no number"),
        (2, ('<Real start="0" unit="ft"/></Sc', '<Real start="nan" unit="ft"/></Sc'),
         "'x' starts at 'nan', which is no number"),
        (2, ('<Real start="1"/>', '<Real start="one"/>'), "'gain' starts at 'one', which is no"),
    ],
)  # fmt: skip
def test_what_an_fmu_says_wrongly_of_itself(lab, lag, version, change, said):
    path = lag(version, change=change)
    problems = lab.problems(lab.write({"b": f'foreign.fmu; file = "{path}"'}, []))
    assert any(said in str(problem) for problem in problems), problems


def test_a_library_of_another_name_is_told_from_another_platform(lab, lag):
    path = lag()
    import zipfile

    with zipfile.ZipFile(path) as old:
        (library,) = (name for name in old.namelist() if name.endswith(".so"))
        content = {name: old.read(name) for name in old.namelist()}
    with zipfile.ZipFile(path, "w") as new:
        for name, data in content.items():
            new.writestr(name.replace("lag.so", "Lag.so"), data)
    (problem,) = lab.problems(lab.write({"b": f'foreign.fmu; file = "{path}"'}, []))
    assert f"holds no {library}, which its description names, but Lag.so" in str(problem)
    assert "only for" not in str(problem)


def test_without_wires_an_fmu_takes_whole_steps_of_its_solver(lab, lag):
    """By default its experiment's step, unless that is not a multiple of the fixed one inside."""
    for inside, step_s, expected in ((0.125, 0.25, 0.25), (0.1, 0.25, 0.1), (0.5, None, 0.5)):
        said = f'<CoSimulation fixedInternalStepSize="{inside}"'
        path = lag(change=("<CoSimulation", said))
        if step_s is None:
            path = lag(change=('stepSize="0.25"', ""))
            import zipfile

            with zipfile.ZipFile(path) as old:
                content = {name: old.read(name) for name in old.namelist()}
            with zipfile.ZipFile(path, "w") as new:
                for name, data in content.items():
                    new.writestr(name, data.replace(b"<CoSimulation", said.encode()))
        tables = lab.run(
            lab.write({"lag": f'foreign.fmu; file = "{path}"'}, [], duration_s=2)
        ).tables
        time_s, _ = _values(tables, "lag", "x")
        assert time_s == pytest.approx(np.arange(0.0, 2.0, expected))
    for rate, fits in ((2, True), (1, True), (10, False)):
        scene = lab.write({"lag": f'foreign.fmu; file = "{path}"; scan_rate_hz = {rate}'}, [],
                          duration_s=1)  # fmt: skip
        (lag_block,) = lab.run(scene).simulation.components.values()
        assert (
            lag_block.warnings() == []
            if fits
            else "0.2 internal steps" in str(lag_block.warnings())
        )


def test_one_that_refuses_to_start_cannot_be_used(lab, lag):
    path = lag()
    import zipfile

    other = lab.folder / "other.fmu"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(other, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, content.replace(b'Token="lag"', b'Token="x"'))
    with pytest.raises(SetupFailure) as caught:
        lab.run(lab.write({"b": f'foreign.fmu; file = "{other}"; scan_rate_hz = 1'}, []))
    assert caught.value.exit_code == 2 and "cannot be instantiated" in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("start = { gian = 1 }", "has no variable 'gian'; did you mean 'gain'"),
        ("start = { gain = true }", "'gain' is True: a number is needed"),
        ("start = { gain = nan }", "'gain' is nan: a number is needed"),
        ('start = { x = "nan ft" }', "'x' is 'nan ft': a number and a unit are needed"),
        ("start = { u = [1, 2] }", "'u' has 2 values where it needs 3"),
        ('start = { x = "3 s" }', "is in 'ft', which 's' cannot be made into"),
        ("start = { fault = 3000000000 }", "it must be from -2147483648 to 2147483647"),
        ('outputs = ["y"]', "has no variable 'y'"),
        ('inputs = { "u[4]" = "a.b" }', "'u' has the elements 1 to 3"),
        ('inputs = { "u[1]" = "traffic" }', "it must be BLOCK.COLUMN"),
        ('inputs = { x = "a.b" }', "has no input 'x'"),
        ("clocks = { tick = [1] }", "has no triggered input clock 'tick'"),
        ('manoeuvre = { turn_rad = "x" }', "is in 'ft', which 'rad' cannot be made into"),
        ('ownship = { own_alt = "x" }', "there is no 'own_alt'; did you mean 'own_alt_m'"),
    ],
)  # fmt: skip
def test_what_a_scene_says_wrongly(lab, lag, keys, said):
    path = lag()
    scene = lab.write({"lag": f'foreign.fmu; file = "{path}"; scan_rate_hz = 1; {keys}'}, [])
    assert any(said in str(problem) for problem in lab.problems(scene)), lab.problems(scene)


def test_other_platforms_and_other_files_are_refused(lab, lag):
    path = lag(platform="aarch64-darwin")
    text = 'foreign.fmu; file = "{}"; scan_rate_hz = 1'
    assert "only for aarch64-darwin" in str(
        lab.problems(lab.write({"b": text.format(path)}, []))[0]
    )
    path.write_bytes(b"no archive")
    assert "is no FMU that can be read" in str(
        lab.problems(lab.write({"b": text.format(path)}, []))[0]
    )


def test_a_column_that_is_not_there_is_named_with_the_nearest(lab, lag):
    text = """
[blocks.lag]
type = "foreign.fmu"
file = "LAG"
inputs = { "u[1]" = "traffic.own_alt" }
"""
    scene = _scene(lab, lag(), text, wires=["traffic -> lag"], duration_s=1)
    with pytest.raises(BlockFailure, match="no column 'own_alt'; did you mean 'own_alt_m'"):
        lab.run(scene)
    scene.write_text(scene.read_text("utf-8").replace("traffic.own_alt", "trafic.own_alt_m"))
    with pytest.raises(SceneError, match="no wire comes from 'trafic'; did you mean 'traffic'"):
        lab.run(scene)


@pytest.mark.parametrize(
    ("name", "rate", "end"), [("BouncingBall", 100, 3), ("Feedthrough", 10, 2)]
)
def test_reference_fmus_give_their_published_output(lab, reference_fmus, name, rate, end):
    import csv

    file = reference_fmus / f"{name}.fmu"
    kind = f'foreign.fmu; file = "{file}"; scan_rate_hz = {rate}'
    scene = lab.write({"a": kind, "b": kind}, [], duration_s=f"{end}.001")
    rows = lab.run(scene).tables["signals"].to_pylist()
    got = {(r["block"], round(r["time_s"], 9), r["signal"]): r["text"] or r["value"] for r in rows}
    with open(reference_fmus / f"{name}_out.csv", encoding="utf-8") as lines:
        for line in csv.DictReader(lines):
            time_s = round(float(line.pop("time")), 9)
            for signal, word in line.items():
                for block in "ab":
                    value = got[block, time_s, signal]
                    if isinstance(value, str):
                        assert value == word
                    else:
                        number = {"true": 1.0, "false": 0.0}.get(word, word)
                        assert value == pytest.approx(float(number), rel=1e-12, abs=1e-12)


@covers("clocks", of=FMU)
def test_clocks_tick_at_exact_instants(lab, reference_fmus):
    scene = lab.write(
        {"c": f'foreign.fmu; file = "{reference_fmus / "Clocks.fmu"}"; '
              "clocks = { inClock2 = [0, 1, 8, 9] }"},
        [], duration_s=10,
    )  # fmt: skip
    tables = lab.run(scene).tables
    last = {name: _values(tables, "c", name)[1][-1] for name in (
        "inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks")}  # fmt: skip
    assert list(last.values()) == [10, 4, 1, 15]
    time_s, raised = _values(tables, "c", "outClock")
    assert time_s[raised > 0].tolist() == [2, 6, 9]  # where the ticks are 5, 10 and 15
    assert not math.isnan(raised[0])


def test_one_that_ends_gives_nothing_more(lab, lag):
    scene = lab.write(
        {"lag": f'foreign.fmu; file = "{lag()}"; scan_rate_hz = 10; '
                "start = { events = 0.05, fault = 5 }"},
        [], duration_s=2,
    )  # fmt: skip
    for window in (None, 1):
        time_s, _ = _values(lab.run(scene, window=window).tables, "lag", "x")
        assert time_s[-1] == pytest.approx(0.5)  # it asks to at its event at 0.55 s


def test_one_of_fmi_2_that_ends_gives_nothing_more_and_one_that_discards_a_step_fails(lab, lag):
    text = f'foreign.fmu; file = "{lag(2)}"; scan_rate_hz = 10; start = {{ u = 1, fault = FAULT }}'
    for window in (None, 1):
        scene = lab.write({"lag": text.replace("FAULT", "5")}, [], duration_s=2)
        time_s, x = _values(lab.run(scene, window=window).tables, "lag", "x")
        assert time_s[-1] == pytest.approx(1.0)
        assert x == pytest.approx(1 - np.exp(-time_s), rel=1e-12)
    with pytest.raises(BlockFailure, match=r"at 1\.1 s: fmi2DoStep returned Discard"):
        lab.run(lab.write({"lag": text.replace("FAULT", "6")}, [], duration_s=2))


def test_a_terminal_takes_its_members_from_one_message(lab, lag):
    import zipfile

    path = lag()
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(
            "terminalsAndIcons/terminalsAndIcons.xml",
            '<fmiTerminalsAndIcons><Terminals><Terminal name="Nav" matchingRule="plug">'
            '<TerminalMemberVariable variableName="u" memberName="own_alt_m" '
            'variableKind="signal"/></Terminal></Terminals></fmiTerminalsAndIcons>',
        )
    text = """
[blocks.lag]
type = "foreign.fmu"
file = "LAG"
start = { n = 1 }
inputs = { Nav = "traffic" }
"""
    tables = lab.run(_scene(lab, path, text, wires=["traffic -> lag"], duration_s=2)).tables
    x = _values(tables, "lag", "x")[1]
    assert _values(tables, "lag", "xu", 1)[1] == pytest.approx(x * 1000 / 0.3048)
    assert x[-1] > 0


def test_what_has_no_solver_is_refused(lab, lag):
    import zipfile

    path, other = lag(), lab.folder / "other.fmu"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(other, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"<CoSimulation", b"<ModelExchange"))
    scene = lab.write({"b": f'foreign.fmu; file = "{other}"; scan_rate_hz = 1'}, [])
    assert "made for model exchange only" in str(lab.problems(scene)[0])


def test_a_signal_is_that_of_its_name_and_of_its_place_in_an_array():
    layout, values = [(0, 0), (1, 1), (1, 2)], np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    given = Signals.of_rows(
        np.array([0, 10]), layout, values, [""] * 6, ("lag", "state"), ("s", "m")
    )
    assert message_column(given, "lag", None, "inputs").tolist() == [1.0, 4.0]
    assert message_column(given, "state", "2", "inputs").tolist() == [3.0, 6.0]
    with pytest.raises(ValueError, match="inputs: there is no signal 'stat'; did you mean 'state'"):
        message_column(given, "stat", None, "inputs")
