"""A session without a browser: who is let in, what is taken in, and what the run folder holds."""

import json
import math
import random
import time
import urllib.error
import urllib.request

import pyarrow.parquet as pq
import pytest

websockets = pytest.importorskip("websockets", reason="needs the package websockets")
from live import LATER, Session, hear, page, say  # noqa: E402
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402

import dsa_des  # noqa: E402
from components.cdti import control  # noqa: E402
from tests.support.waiting import WAIT_S, wait_for  # noqa: E402

TURN = {"type": "decide", "decision": "turn", "target": 0, "value": 45}


def ident(number):
    return f"{number:016x}"


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A session that has not begun, for what needs no run."""
    with pytest.MonkeyPatch.context() as patch:
        session = Session(patch, tmp_path_factory.mktemp("cdti") / "run", duration="0.5")
        with page(session) as (_, welcome):
            key = welcome["key"]
        yield session
        with page(session, key=key) as (socket, _):
            say(socket, type="ready")
            hear(socket, "end")
        session.ended()


def asked(url, **headers):
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=WAIT_S) as answer:
            return answer.status, dict(answer.headers), answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, dict(error.headers), error.read().decode()


def test_the_page_comes_with_a_policy_that_lets_it_do_nothing_else(live):
    status, headers, text = asked(live.address)
    assert status == 200 and "<canvas" in text
    policy = dict(part.split(" ", 1) for part in headers["Content-Security-Policy"].split("; "))
    assert policy["default-src"] == policy["frame-ancestors"] == "'none'"
    assert policy["connect-src"] == f"ws://{live.authority}"
    assert policy["script-src"].startswith("'sha256-") and " " not in policy["script-src"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer" and headers["Cache-Control"] == "no-store"
    assert "http://" not in text and "https://" not in text


def test_nothing_is_served_to_who_does_not_know_the_address(live):
    base = f"http://{live.authority}/"
    assert [asked(base + rest)[0] for rest in ("", "?token=", "?token=x", "socket")] == [403] * 4
    assert asked(live.address, Host="evil.example")[0] == 403  # a name made to lead here
    assert asked(f"{base}etc/passwd?token={live.token}")[0] == 404


@pytest.mark.parametrize(
    "options",
    [
        {"origin": "http://evil.example"}, {"origin": None}, {"origin": "null"},
        {"origin": "http://127.0.0.1:1"}, {"token": "x"}, {"token": ""},
    ],
)  # fmt: skip
def test_no_socket_for_a_page_of_another_origin(live, options):
    with pytest.raises(InvalidStatus) as refused, live.socket(**options):
        pass
    assert refused.value.response.status_code == 403


def test_a_whole_session_and_its_replay(tmp_path, monkeypatch):
    swaps = ("tracker=tracking.stub",)
    began = time.time()
    session = Session(monkeypatch, tmp_path / "run", realtime="16", duration="20", swaps=swaps,
                      until=lambda picture: picture["alerts"],
                      sets=(*LATER, "blocks.operator.turn_rate_deg_s=5",
                            "blocks.operator.latency_s=0.4"))  # fmt: skip
    with page(session) as (socket, welcome), page(session) as (other, beside):
        assert (welcome["role"], beside["role"]) == ("operator", "watcher")
        assert welcome["console"] and not welcome["began"]
        say(other, type="ready")
        assert hear(other, "refused")["why"] == "this page only watches"
        say(socket, type="ready")
        frame = wait_for(lambda: (f := hear(socket, "frame"))["alerts"] and f)
        assert frame["contacts"][0][1] is not None and frame["alerts"][0]["target"] == 0
        say(other, **TURN, id=ident(1))
        assert hear(other, "refused")["why"] == "this page only watches"
        say(socket, type="decide", decision="verified", target=0, id=ident(2))
        verified = hear(socket, "taken")
        say(socket, **{**TURN, "target": 5}, id=ident(3))
        assert hear(socket, "refused")["why"] == "there is no such target"
        say(socket, **{**TURN, "decision": "climb", "value": -2000}, id=ident(5))
        assert hear(socket, "refused")["why"] == "that leads below the ground"
        say(socket, **TURN, id=ident(4))
        taken = hear(socket, "taken")
        assert hear(other, "taken")["id"] == ident(2)  # who watches sees what is decided
        say(socket, **{**TURN, "decision": "climb", "value": 60}, id=ident(6))
        climbed = hear(socket, "taken")
        say(socket, **{**TURN, "value": -15}, id=ident(7))
        turned_back = hear(socket, "taken")
        assert "replaces" not in {**taken, **climbed}
        assert turned_back["replaces"] == {"time": taken["time"], "value": 45}
        assert taken["ends"] == pytest.approx(taken["time"] + 45 / 5)
        own = frame["own"]
        assert taken["to"] == pytest.approx((own["heading"] + 45) % 360, abs=0.1)
        assert climbed["to"] == pytest.approx(own["alt"] + 60, abs=0.2)
        assert verified["level"] == taken["level"] >= 1 and "to" not in verified
    # The page is gone; what it was told is taken in stays, and the run goes on.
    with page(session, key=welcome["key"]) as (socket, again):
        assert again["role"] == "operator"
        assert [one["id"] for one in again["log"]] == [ident(2), ident(4), ident(6), ident(7)]
        say(socket, **TURN, id=ident(4))  # said again, as if the answer had been lost
        assert hear(socket, "taken") == taken
        session.go_on()
        assert hear(socket, "end")["why"] == "the scene has come to its end"
        with pytest.raises((ConnectionClosed, TimeoutError)):
            socket.recv(timeout=10)
    session.ended()
    decided = pq.read_table(session.out / "decisions.parquet").to_pylist()
    assert [(row["decision"], row["time_s"]) for row in decided] == [
        ("verified", verified["time"]), ("turn", taken["time"]), ("climb", climbed["time"]),
        ("turn", turned_back["time"]),
    ]  # fmt: skip
    assert [row["replaces_s"] for row in decided] == [None, None, None, taken["time"]]
    told = [(row["turn_rad"], row["climb_m"]) for row in decided]
    assert told == [
        (0.0, 0.0), (pytest.approx(math.pi / 4), 0.0), (0.0, 60.0),
        (pytest.approx(-math.pi / 12), 0.0),
    ]  # fmt: skip
    assert began <= decided[1]["wall_time_s"] <= time.time()
    replayed = tmp_path / "replayed"
    dsa_des.run(dsa_des.load_scene(session.out / "scene.toml"), out=replayed)
    for name in [p.name for p in session.out.glob("*.parquet")] + ["scene.toml"]:
        assert (replayed / name).read_bytes() == (session.out / name).read_bytes(), name
    timings = json.loads((session.out / "run.json").read_text())["timings"]["realtime"]
    assert timings["factor"] == 16 and timings["paused_s"] > 0


def test_what_is_no_message_changes_nothing(tmp_path, monkeypatch):
    """A tenth of `measure.py --fuzz`, over the socket of an operator."""
    session = Session(monkeypatch, tmp_path / "run", realtime="20", duration="2")
    draw = random.Random(7)
    with page(session) as (socket, welcome):
        for number in range(300):
            socket.send(fuzz(draw, number))
        refused = [hear(socket, "refused") for _ in range(300)]
        assert all(one["why"].startswith("this is") for one in refused)
        assert not welcome["began"]
        say(socket, type="ready")
        hear(socket, "end")
    session.ended()
    assert pq.read_table(session.out / "decisions.parquet").num_rows == 0


def fuzz(draw, number):
    """Something that is nearly a message, or nothing like one."""
    good = json.dumps({**TURN, "id": ident(number)})
    kind = number % 4
    if kind == 0:
        return bytes(draw.randrange(256) for _ in range(draw.randrange(200)))
    if kind == 1:
        place = draw.randrange(len(good) - 1)
        return good[:place] + chr(draw.randrange(1, 9)) + good[place + 1 :]
    if kind == 2:
        key = draw.choice(["type", "decision", "target", "value", "id"])
        value = draw.choice([None, [], {}, -(10**12), 1e308, "<script>", "💥", ["turn"]])
        return json.dumps({**TURN, "id": ident(number), key: value})
    return json.dumps({**TURN, "id": ident(number), f"x{number}": 1})


def test_what_is_too_long_closes_the_door(live):
    with pytest.raises(ConnectionClosed) as closed, live.socket() as socket:
        socket.send("x" * 5000)
        while True:
            socket.recv(timeout=WAIT_S)
    assert closed.value.rcvd.code == 1009


def test_a_page_that_draws_nothing_gets_two_pictures_and_holds_nobody_up(tmp_path, monkeypatch):
    session = Session(monkeypatch, tmp_path / "run", realtime="4", duration="4", no_wait=True,
                      until=lambda picture: True)  # fmt: skip
    kinds = []
    with session.socket() as lazy:

        def hear_all(*last):
            while kinds[-1:] != [*last]:
                kinds.append(json.loads(lazy.recv(timeout=WAIT_S))["type"])

        hear_all("frame")
        session.go_on(until=lambda picture: picture["t"] > 1.0)
        kinds.append("another")
        hear_all("frame")
        session.go_on()
        hear_all("end")
    session.ended()
    assert kinds.count("frame") == 2
    paced = next(text for text in session.said if "paced at" in text)
    assert "0 decisions taken in, up to 4.0 s" in paced


@pytest.mark.parametrize("unattended", ["goes on", "pauses"])
def test_the_run_goes_on_or_pauses_without_its_operator(tmp_path, monkeypatch, unattended):
    monkeypatch.setattr(control, "GONE_S", 0.1)
    sets = ("record.truth=false", f"blocks.operator.unattended='{unattended}'")
    session = Session(monkeypatch, tmp_path / "run", realtime="8", duration="6", sets=sets,
                      until=lambda picture: picture["t"] > 0.0)  # fmt: skip
    with page(session) as (socket, _), session.socket() as other:
        assert hear(other, "welcome")["role"] == "watcher"
        say(socket, type="ready")
        hear(socket, "frame")
        session.stands()
        monkeypatch.setattr(control, "FRAME_S", 1e9)
        socket.close()
        # Whoever watches is told, though a run that pauses comes to no other instant.
        wait_for(lambda: hear(other, "frame")["operators"] == 0)
        session.go_on()
        if unattended == "goes on":
            hear(other, "end")
        else:
            with pytest.raises(TimeoutError):
                hear(other, "end", timeout=1.5)
    if unattended == "pauses":  # whoever sits at the terminal lets another page decide
        token = session.new_address().partition("token=")[2]
        with page(session, token=token) as (socket, welcome):
            assert welcome["role"] == "operator"
            hear(socket, "end")
    session.ended()


def test_a_tab_that_is_opened_again_decides_while_nobody_else_does(tmp_path, monkeypatch):
    """Its browser still has the key; while another page decides, that one keeps its place."""
    session = Session(monkeypatch, tmp_path / "run", realtime="8", duration="6",
                      until=lambda picture: picture["t"] > 0.0)  # fmt: skip
    with page(session) as (socket, welcome):
        say(socket, type="ready")
        key = welcome["key"]
        asked = f"{session.token}&before={key}"
        with page(session, token=asked) as (_, beside):
            assert beside["role"] == "watcher"
        with page(session, token=f"{session.token}&before=guess") as (_, guessing):
            assert guessing["role"] == "watcher"
        socket.close()
        wait_for(lambda: session.control._operators == 0)
        with page(session, token=asked) as (_, again):
            assert again["role"] == "operator" and again["key"] == key
    session.go_on()
    session.stop()
    session.ended()


def test_nothing_is_simulated_before_the_run_is_held_no_more(monkeypatch):
    monkeypatch.setattr(control, "_LOOK_AGAIN_S", 0.001)
    answers = iter([True, True, False])
    pacer = control.LivePacer(1.0, lambda: next(answers), lambda time_s, lag_s: None)
    pacer.start()
    assert list(answers) == [] and pacer.paused_s > 0.0
