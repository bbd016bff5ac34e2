"""Programs as blocks: that they work, and none of their ways to fail leaves anything behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from covering import covers
from wired import chain

import dsa_des
from components.foreign.process_link import ProcessError, ProcessLink, frame_parts_of_batch
from components.messages.state_tracks import COVARIANCE
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.running.simulation import Simulation
from tests import warm_process
from tests.support.waiting import wait_for

CANNED = str(Path(__file__).with_name("canned.py"))
EYE = {"type": "optical.range_boundary", "range_km": 20.0, "scan_rate_hz": 5}


@pytest.fixture
def folder(tmp_path):
    empty = pa.RecordBatch.from_arrays([], schema=pa.schema([]))
    for name, version in (("hello", "1"), ("hello_2", "2")):
        (tmp_path / name).write_bytes(
            b"".join(frame_parts_of_batch("hello", empty, {"version": version}))
        )
    return tmp_path


def canned(way, call, folder):
    return [sys.executable, CANNED, way, str(call), str(folder)]


def write_table(folder, name, columns):
    """Let the program answer a table."""
    content = frame_parts_of_batch(name, pa.RecordBatch.from_pydict(columns), {})
    (folder / "table").write_bytes(b"".join(content))


def scene(command, duration_s=1, **keys):
    found = chain({"eye": EYE}, duration_s=duration_s, fusion={"type": "fusion.pass_through"})
    found["blocks"]["part"] = {"type": "foreign.process", "command": command, **keys}
    found["wires"] += ["eye -> part -> fusion"]
    return found


def gone(folder, name="pid"):
    """Whether a process of the program has ended, sooner or later."""
    pid = int((folder / name).read_text())

    def ended():
        try:
            status = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        return status == "Z"

    return wait_for(ended)


@covers("command", "deadline_s", of=("foreign.process",))
@pytest.mark.parametrize(
    ("way", "said"),
    [
        ("die", "ended with exit code 7; its last words: line one | the engine is on fire"),
        ("signal", "died of signal 11 (SIGSEGV); its last words"),
        ("hang", "has not answered within deadline_s = 100 s; its last words"),
        ("garbage", "sent what is no message: b'Hello, w'"),
        ("no_arrow", "sent what is no Arrow stream"),
        ("half", "ended with exit code 0 in the middle of a message"),
        ("more", "sent 8 bytes that nobody asked for"),
    ],
)
def test_a_program_that_fails_ends_the_run_with_its_last_words(folder, way, said, monkeypatch):
    clock, hangs = time.monotonic, folder / "child"
    monkeypatch.setattr(time, "monotonic", lambda: clock() + (100.0 if hangs.exists() else 0.0))
    with pytest.raises(BlockFailure) as error:
        dsa_des.run(scene(canned(way, 3, folder), deadline_s=100.0))
    assert said in str(error.value) and "t = 0.4" in str(error.value)
    assert error.value.exit_code == 3
    assert gone(folder)
    if way == "hang":
        assert gone(folder, "child")


@pytest.mark.parametrize("call", [1, 2, 5])
def test_a_kill_at_any_call_is_one_error_or_a_new_start(folder, call):
    with pytest.raises(BlockFailure, match="exit code 7"):
        dsa_des.run(scene(canned("once", call, folder)))
    (folder / "misbehaved").unlink()
    run = dsa_des.run(scene(canned("once", call, folder), on_failure="restart"))
    assert run.info["summary"]["restarts"] == {"part": 1}
    assert gone(folder)


@covers("on_failure", "most_restarts", of=("foreign.process",))
def test_restarts_are_counted(folder):
    again = scene(canned("die", 2, folder), on_failure="restart", most_restarts=2)
    with pytest.raises(BlockFailure, match=r"t = 0\.6"):  # each start lives for one call
        dsa_des.run(again)


def test_another_version_is_refused(folder):
    with pytest.raises(BlockFailure, match="speaks version '2'"):
        dsa_des.run(scene(canned("version", 1, folder)))
    assert gone(folder)


def test_a_slow_answer_and_many_words_do_no_harm(folder):
    dsa_des.run(scene(canned("slow", 2, folder)))
    dsa_des.run(scene(canned("chatty", 0, folder)))
    assert gone(folder)


@pytest.mark.parametrize(
    ("table", "columns", "said"),
    [
        ("manoeuvre", {"turn_rad": [1.0]}, "did you mean 'manoeuvres'"),
        ("manoeuvres", {"turn_rad": [1.0]}, "there is no column 'rate_rad_s'"),
        ("manoeuvres", {"turn_rad": ["x"], "rate_rad_s": [1.0]}, "numbers are needed"),
        ("manoeuvres", {"turn_rad": [np.nan], "rate_rad_s": [1.0]}, "finite numbers"),
        ("detections", {"azimuth_rad": [0.0], "elevation_rad": [0.0], "target": ["rollin"]},
         "did you mean 'rolling'"),
    ],
)  # fmt: skip
def test_a_table_that_is_none_of_ours_is_said(folder, table, columns, said):
    write_table(folder, table, columns)
    with pytest.raises(BlockFailure, match=said):
        dsa_des.run(scene(canned("table", 1, folder)))
    assert gone(folder)


def test_detections_of_a_program_are_fused_as_any(folder):
    columns = {
        "azimuth_rad": [0.5],
        "elevation_rad": [0.1],
        "range_m": [900.0],
        "target": ["diving"],
    }
    (folder / "table").write_bytes(
        b"".join(frame_parts_of_batch("detections", pa.RecordBatch.from_pydict(columns), {}))
    )
    found = scene(canned("table", 3, folder))
    found["wires"].remove("eye -> fusion")
    rows = dsa_des.run(found).fused.to_pylist()
    assert [(r["time_s"], r["target"], r["range_m"], r["sensors"]) for r in rows] == [
        (0.4, "diving", 900.0, "part")
    ]  # fmt: skip


@covers("scan_rate_hz", "offset_s", of=("foreign.process",))
def test_it_is_called_on_a_clock_of_its_own(folder):
    columns = {"turn_rad": [1.0], "rate_rad_s": [0.1]}
    (folder / "table").write_bytes(
        b"".join(frame_parts_of_batch("manoeuvres", pa.RecordBatch.from_pydict(columns), {}))
    )
    found = scene(canned("table", 2, folder), scan_rate_hz=4, offset_s="0.1")
    found["wires"].remove("eye -> part -> fusion")
    found["wires"].append({"from": "part", "to": "traffic", "delay_s": 0.1, "holds": "nothing"})
    assert dsa_des.run(found).manoeuvres.column("time_s").to_pylist() == [0.35]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("python3 -c pass", "must be a list of words"),
        (["no-such-program-of-ours"], "there is no program 'no-such-program-of-ours'"),
        ([], "at least 1"),
    ],
)
def test_commands_are_lists_of_what_is_there(command, said):
    with pytest.raises(SceneError) as error:
        dsa_des.load_scene(scene(command))
    assert said in str(error.value)


def test_no_shell_looks_at_the_words(folder):
    command = canned("slow", 0, folder)
    dsa_des.run(scene([*command, "; touch injected", "$(touch injected)"], folder=str(folder)))
    assert not (folder / "injected").exists()


@covers("folder", of=("foreign.process",))
def test_a_program_is_looked_for_beside_the_scene(folder):
    program = folder / "part.sh"
    program.write_text(f"#!/bin/sh\nexec {' '.join(canned('die', 1, folder))}\n")
    program.chmod(0o755)
    with pytest.raises(BlockFailure, match="exit code 7"):
        dsa_des.run(scene(["./part.sh"], folder=str(folder)))


def test_an_exception_elsewhere_leaves_nothing_running(folder):
    found = scene(canned("slow", 0, folder))
    found["blocks"]["other"] = {
        "type": "foreign.process", "command": canned("die", 3, folder / "other")
    }  # fmt: skip
    (folder / "other").mkdir()
    (folder / "other" / "hello").write_bytes((folder / "hello").read_bytes())
    found["wires"].append("eye -> other -> fusion")
    with pytest.raises(BlockFailure, match="exit code 7") as error:
        dsa_des.run(found)
    del error
    assert gone(folder / "other")
    assert gone(folder)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_is_left_when_we_are_interrupted_or_killed(folder, number):
    file = folder / "scene.toml"
    command = canned("hang", 2, folder)
    file.write_text(
        "duration_s = 1\nseed = 1\n"
        'wires = ["part -> fusion"]\n[blocks.fusion]\ntype = "fusion.pass_through"\n'
        f"[blocks.part]\ntype = 'foreign.process'\nscan_rate_hz = 5\ncommand = {command}\n"
    )
    words = ["-m", "dsa_des", "run", file, "--out", folder / "out"]
    ours = warm_process.start(words, stdout=subprocess.DEVNULL)
    child = folder / "child"
    wait_for(lambda: child.exists() and child.read_text())
    os.kill(ours.pid, number)
    _, said = ours.communicate()
    assert ours.returncode == (-9 if number == signal.SIGKILL else 128 + number), said
    assert gone(folder) and gone(folder, "child")
    assert not (folder / "out" / "run.json").exists()


def test_ten_thousand_calls_and_hundreds_of_megabytes(folder):
    link = ProcessLink(canned("echo", 0, folder), folder)
    link.start()
    batch = pa.RecordBatch.from_pydict({"x": np.arange(3.0)})
    empty = pa.RecordBatch.from_arrays([], schema=pa.schema([]))
    link.ask(frame_parts_of_batch("hello", empty, {}), 5.0)
    call = frame_parts_of_batch("call", batch, {})
    for _ in range(10_000):
        link.ask(call, 5.0)
    large = pa.RecordBatch.from_pydict({"x": np.random.default_rng(1).random(13_000_000)})
    ((about, table),) = link.ask(frame_parts_of_batch("large", large, {}), 60.0)
    assert (
        about["table"] == "large"
        and table.column("x").to_numpy()[-1] == large.column(0)[-1].as_py()
    )
    link.stop()
    assert gone(folder)
    with pytest.raises(ProcessError, match="cannot be started"):
        ProcessLink(["/no/such"], folder).start()


@covers("arguments", "snapshots", of=("foreign.process",))
def test_a_program_that_is_taken_back_looks_ahead_and_changes_nothing():
    found = scene([sys.executable, str(Path(__file__).with_name("counts.py"))], duration_s=8)
    found["wires"].remove("eye -> part -> fusion")
    found["wires"] += [
        "eye -> part", {"from": "part", "to": "traffic", "delay_s": 0.3, "holds": "nothing"}
    ]  # fmt: skip
    found["blocks"]["part"] |= {"deadline_s": 20.0, "arguments": {"every": 5}}
    by_scan, windowed = dsa_des.run(found), []
    for snapshots in (True, False):
        found["blocks"]["part"]["snapshots"] = snapshots
        nodes = Simulation(dsa_des.load_scene(found)).nodes
        windowed.append(sorted(name for name, node in nodes.items() if node.windowed))
    assert "part" in windowed[0] and windowed[1] == []
    found["blocks"]["part"]["snapshots"] = True
    ahead = dsa_des.run(found)
    assert by_scan.manoeuvres.num_rows == 8
    for name in ("manoeuvres", "detections", "scans", "truth"):
        assert getattr(ahead, name).to_pylist() == getattr(by_scan, name).to_pylist(), name


def counting(**arguments):
    """Run a program that may be killed and started again."""
    command = [sys.executable, str(Path(__file__).with_name("counts.py"))]
    found = scene(command, duration_s=8, snapshots=True, on_failure="restart")
    found["wires"].remove("eye -> part -> fusion")
    found["wires"] += [
        "eye -> part", {"from": "part", "to": "traffic", "delay_s": 0.3, "holds": "nothing"}
    ]  # fmt: skip
    found["blocks"]["part"]["arguments"] = {"every": 5, **arguments}
    return dsa_des.run(found)


@pytest.fixture(scope="module")
def undisturbed():
    return counting()


@pytest.mark.parametrize("call", [1, 4, 17, 38])
def test_one_that_is_killed_and_started_again_goes_on_from_its_state(tmp_path, call, undisturbed):
    killed = counting(dies_at=call, marker=str(tmp_path / "died"))
    assert (tmp_path / "died").exists()
    assert killed.info["summary"]["restarts"] == {"part": 1}
    assert killed.manoeuvres.to_pylist() == undisturbed.manoeuvres.to_pylist()
    assert killed.detections.to_pylist() == undisturbed.detections.to_pylist()


def test_a_program_that_cannot_be_taken_back_says_so(folder):
    with pytest.raises(BlockFailure, match=r"cannot hand out its state .* leave out snapshots"):
        dsa_des.run(scene(canned("slow", 0, folder), snapshots=True))
    assert gone(folder)


def test_a_run_says_which_program_makes_others_go_scan_by_scan(folder):
    found = scene(canned("slow", 0, folder))
    notes = dsa_des.run(found, out=folder / "run").info["notes"]
    (said,) = (note for note in notes if note.startswith("blocks.part: "))
    assert "foreign.process" in said or "components.foreign.process:Process" in said
    assert "because of it fusion run scan by scan" in said
    found["wires"] = [wire for wire in found["wires"] if wire != "eye -> part -> fusion"]
    found["wires"] += ["eye -> part"]  # nothing is behind it now
    notes = dsa_des.run(found, out=folder / "run").info.get("notes", [])
    assert not any("scan by scan" in note for note in notes)


def state_tracks(**changes):
    """One track 3 km north of the frame's origin, 1 km east and 500 m above the ownship."""
    state = dict(zip(("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s"),
                     (3000.0, 1000.0, -700.0, -40.0, 5.0, 1.0), strict=True))  # fmt: skip
    own = {"own_north_m": 0.0, "own_east_m": 0.0, "own_down_m": -200.0}
    origin = {"origin_lat_deg": -41.3, "origin_lon_deg": -179.9997, "origin_alt_m": 2200.0}
    spread = {name: 100.0 if name[11] == name[12] else 0.0 for name in COVARIANCE.values()}
    table = {"track": 7, **state, **own, **origin, **spread, "track_status": "coasted"} | changes
    return {name: [value] for name, value in table.items() if value is not None}


def test_a_tracker_of_others_gives_tracks_with_states(folder):
    write_table(folder, "state_tracks", state_tracks())
    found = scene(canned("table", 2, folder))
    found["wires"].remove("eye -> part -> fusion")
    found["wires"] += ["eye -> part", "part -> together"]
    found["blocks"]["together"] = {"type": "fusion.covariance_intersection"}
    run = dsa_des.run(found)
    (row,) = (row for row in run.state_tracks.to_pylist() if row["block"] == "part")
    (fused,) = (row for row in run.state_tracks.to_pylist() if row["block"] == "together")
    assert (fused["north_m"], fused["updated_by"]) == (pytest.approx(3000.0), "part")
    assert (row["time_s"], row["track"], row["track_status"]) == (0.2, 7, "coasted")
    assert row["azimuth_rad"] == pytest.approx(np.arctan2(1000, 3000))
    assert row["elevation_rad"] == pytest.approx(np.arctan2(500, np.hypot(1000, 3000)))
    # 10 m across at 3162 m, and what is upward at the slant range.
    assert row["azimuth_variance_rad2"] == pytest.approx(100 / (1000**2 + 3000**2))
    assert row["elevation_variance_rad2"] == pytest.approx(100 / (1000**2 + 3000**2 + 500**2))
    assert row["has_range"] and row["updated_by"] == "part" and row["state_s"] == 0.2


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"covariance_35_m2_s2": None}, "there is no column 'covariance_35_m2_s2'"),
        ({"covariance_11_m2": -1.0}, "'covariance_11_m2': a variance of at least 0"),
        ({"own_north_m": float("nan")}, "'own_north_m': finite numbers"),
        ({"east_m": float("nan")}, "'azimuth_rad': a track without a state needs a direction"),
        ({"track": 0}, "'track': whole numbers from 1"),
        ({"track_status": "confirmd"}, "did you mean 'confirmed'"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_tracks_is_said(folder, changes, said):
    write_table(folder, "state_tracks", state_tracks(**changes))
    with pytest.raises(BlockFailure, match=said):
        dsa_des.run(scene(canned("table", 1, folder)))
    assert gone(folder)


@pytest.mark.parametrize("way", ["quiet", "table"])
def test_a_program_that_says_nothing_is_counted(folder, way):
    """It is asked at five looks; nothing comes back, or at the fourth a detection."""
    write_table(folder, "detections", {"azimuth_rad": [0.5], "elevation_rad": [0.1]})
    found = Simulation(dsa_des.load_scene(scene(canned(way, 4, folder)))).run().failure_counts
    silent = {"it was asked and answered with no row": (5, 5)}
    assert found.get("part", {}) == (silent if way == "quiet" else {})
