"""Ctrl-C ends a session, and keeps what was flown and decided up to there."""

import json
import signal

import pyarrow.parquet as pq
import pytest

pytest.importorskip("websockets", reason="needs the package websockets")
from live import Session, hear, page, say

import dsa_des
from tests import warm_process
from tests.support.waiting import wait_for


def test_what_was_decided_is_kept_when_the_run_is_stopped(tmp_path, monkeypatch):
    session = Session(monkeypatch, tmp_path / "run", realtime="4", duration="600", no_wait=True)
    with page(session) as (socket, _):
        hear(socket, "frame")
        say(socket, type="decide", decision="turn", target=-1, value=-20, id="0" * 16)
        taken = hear(socket, "taken")
        session.stop()
        hear(socket, "end")
    session.ended()
    (row,) = pq.read_table(session.out / "decisions.parquet").to_pylist()
    assert (row["decision"], row["time_s"]) == ("turn", taken["time"])
    info = json.loads((session.out / "run.json").read_text())
    assert info["stopped"] and taken["time"] <= info["duration_s"] < 600
    loaded = dsa_des.load_scene(session.out / "scene.toml", duration_s=info["duration_s"])
    again = dsa_des.run(loaded)
    for name in ("truth", "detections", "decisions"):
        assert again.tables[name].equals(pq.read_table(session.out / f"{name}.parquet")), name


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_with_a_complete_folder(tmp_path, number, code):
    out = tmp_path / "runs" / "stopped"
    words = ["-m", "dsa_des", "cdti", "operator/session", "--no-wait", "--out", str(out)]
    process = warm_process.start(words)
    wait_for(lambda: list(tmp_path.glob("runs/.dsa_des-*/*/detections.parquet"))
             or list(tmp_path.glob("runs/.dsa_des-*/detections.parquet")))  # fmt: skip
    process.send_signal(number)
    stdout, stderr = process.communicate()
    assert process.returncode == code
    assert "display: http://127.0.0.1:" in stdout and "run: " in stdout
    assert stderr.splitlines()[-1].startswith("stopped: ")
    assert json.loads((out / "run.json").read_text())["stopped"]
    assert [p.name for p in out.parent.iterdir()] == ["stopped"]
