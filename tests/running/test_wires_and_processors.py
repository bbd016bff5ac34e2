"""What wires, latencies and processors do to the time of what comes after them."""

import crooked
import pytest
from covering import covers
from wired import chain, rows, run, sensor

RADAR = sensor("radar.range_boundary", scan_rate_hz=4)
FUSION = {"type": "fusion.pick_best"}
ONE = [crooked.ROLLING]


def scene(*, radar=RADAR, wire=None, duration_s: float = 2, **sections) -> dict:
    """A radar and its fusion, with options on the wire between them."""
    found = chain({"radar": radar}, targets=ONE, fusion=FUSION, duration_s=duration_s, **sections)
    if wire is not None:
        found["wires"].remove("radar -> fusion")
        found["wires"].append({"from": "radar", "to": "fusion", **wire})
    return found


def fused_s(found: dict) -> list[float]:
    return [row["time_s"] for row in rows(run(found), "fused")]


GRID = [0.25 * k for k in range(8)]


@covers("from", "to", "delay_s", of=("[wires]",))
@covers("wires", of=("[scene]",))
@pytest.mark.parametrize("ends", [{}, {"from": "radar.detections", "to": "fusion.detections"}])
@pytest.mark.parametrize("delay_s", [0, 0.07])
def test_a_message_is_on_its_wire_as_long_as_it_says(delay_s, ends):
    found = fused_s(scene(wire={**ends, "delay_s": delay_s}))
    assert found == pytest.approx([time + delay_s for time in GRID])


def test_a_wire_that_is_not_there_carries_nothing():
    found = scene()
    found["blocks"]["other"] = sensor("radar.range_boundary", scan_rate_hz=4)
    found["wires"] += ["gate -> other"]
    assert {row["sensors"] for row in rows(run(found), "fused")} == {"radar"}


@covers("delay", of=("[wires]",))
@pytest.mark.parametrize(("delay", "scans"), [("1 scan", 1), ("3 scans", 3)])
def test_a_delay_in_scans_is_of_the_receiver_s_clock(delay, scans):
    """What the radar sees at a scan is what was sent that many of its scans before."""
    found = scene(radar=RADAR)
    found["wires"].remove("gate -> radar")
    found["wires"].append({"from": "gate", "to": "radar", "delay": delay})
    seen = {row["time_s"]: row["true_range_m"] for row in rows(run(found))}
    plain = {row["time_s"]: row["true_range_m"] for row in rows(run(scene()))}
    assert sorted(seen) == pytest.approx(GRID[scans:])
    for time in seen:
        assert seen[time] == pytest.approx(plain[time - 0.25 * scans])


def test_two_receivers_of_a_wire_each_count_their_own_scans():
    sensors = {
        "slow": sensor("radar.range_boundary", scan_rate_hz=4),
        "fast": sensor("radar.range_boundary", scan_rate_hz=10, offset_s=0.05),
    }
    plain = chain(sensors, targets=ONE, duration_s=2)
    late = chain(sensors, targets=ONE, duration_s=2)
    late["wires"] = ["traffic -> transform -> gate"]
    late["wires"] += [{"from": "gate", "to": name, "delay": "2 scans"} for name in sensors]
    truth = {row["time_s"]: row["true_range_m"] for row in rows(run(plain))}
    for name, before_s in (("slow", 0.5), ("fast", 0.2)):
        seen = rows(run(late), block=name)
        assert len(seen) > 5
        for row in seen:
            then = min(truth, key=lambda t: abs(t - (row["time_s"] - before_s)))
            assert row["true_range_m"] == pytest.approx(truth[then], abs=1e-6)


@covers("jitter_s", of=("[wires]",))
@pytest.mark.parametrize("jitter_s", [0.01, 0.2])
def test_jitter_is_the_largest_extra_delay(jitter_s):
    radar = {**RADAR, "scan_rate_hz": 40}
    late = []
    found = run(scene(radar=radar, wire={"delay_s": 0.5, "jitter_s": jitter_s}, duration_s=3))
    ranges = {row["true_range_m"]: row["time_s"] for row in rows(found)}
    for row in rows(found, "fused"):
        late.append(row["time_s"] - ranges[row["true_range_m"]] - 0.5)
    assert len(late) > 85
    assert -1e-9 <= min(late) < 0.1 * jitter_s
    assert 0.9 * jitter_s < max(late) <= jitter_s + 1e-9
    assert sum(late) / len(late) == pytest.approx(0.5 * jitter_s, rel=0.2)


@covers("drop_probability", of=("[wires]",))
@pytest.mark.parametrize(("share", "low", "high"), [(0, 200, 200), (0.3, 115, 165), (1, 0, 0)])
def test_a_share_of_the_messages_is_lost(share, low, high):
    radar = {**RADAR, "scan_rate_hz": 100}
    found = run(scene(radar=radar, wire={"drop_probability": share}))
    assert len(rows(found, "scans")) == 200
    assert low <= len(rows(found, "fused")) <= high


@covers("holds", of=("[wires]",))
def test_a_loop_holds_what_its_wire_says_before_the_first_message():
    """Without the word no loop is run; "nothing" leaves the ownship alone until told."""
    import dsa_des

    found = scene()
    found["blocks"]["tracker"] = {"type": "tracking.stub"}
    found["blocks"]["avoidance"] = {"type": "avoidance.turn_away"}
    back = {"from": "avoidance", "to": "traffic", "delay_s": 0.6}
    found["wires"] += ["fusion -> tracker", "tracker -> avoidance", back]
    with pytest.raises(dsa_des.SceneError, match="holds"):
        dsa_des.load_scene(found)
    back["holds"] = "nothing"
    free = {row["time_s"]: row["true_azimuth_rad"] for row in rows(run(scene()))}
    for row in rows(run(found)):
        turned = row["true_azimuth_rad"] - free[row["time_s"]]
        assert (abs(turned) > 1e-3) is (row["time_s"] > 0.7), row["time_s"]


@covers("holds", of=("[wires]",))
def test_what_a_wire_holds_is_there_before_the_first_message():
    """Tracks that turn up 0.6 s late: an empty table of them is a message, "nothing" is none."""
    import dsa_des

    found = scene()
    found["blocks"]["tracker"] = {"type": "tracking.stub"}
    found["blocks"]["avoidance"] = {"type": "avoidance.turn_away"}
    late = {"from": "tracker", "to": "avoidance", "delay_s": 0.6}
    back = {"from": "avoidance", "to": "traffic", "delay_s": 0.1, "holds": "nothing"}
    found["wires"] += ["fusion -> tracker", late, back]
    told = []
    for holds in ({}, "nothing"):
        late["holds"] = holds
        told.append(rows(run(found), "manoeuvres"))
    assert told[0] == told[1] != []
    late["holds"] = {"target": ["one"]}
    with pytest.raises(dsa_des.SceneError, match="empty table"):
        dsa_des.load_scene(found)


@covers("latency_s", of=("[blocks]",))
@pytest.mark.parametrize("latency_s", [0.03, 0.4])
def test_a_latency_is_between_an_instant_and_its_message(latency_s):
    found = run(scene(radar={**RADAR, "latency_s": latency_s}))
    assert [row["time_s"] for row in rows(found)] == pytest.approx(GRID)
    later = [time + latency_s for time in GRID if time + latency_s < 2]
    assert [row["time_s"] for row in rows(found, "fused")] == pytest.approx(later)


@covers("processor", of=("[blocks]",))
@covers("processors", of=("[scene]",))
@covers("service_s", of=("[processors]",))
@pytest.mark.parametrize("service_s", [0.05, 0.3])
def test_a_processor_works_on_one_message_at_a_time(service_s):
    radar = {**RADAR, "processor": "chip"}
    others = {"idle": {"service_s": 0.9}, "chip": {"service_s": service_s}}
    found = run(scene(radar=radar, processors=others))
    done, free = [], 0.0
    for time in GRID:
        free = max(time, free) + service_s
        if free < 2:
            done.append(free)
    assert [row["time_s"] for row in rows(found, "fused")] == pytest.approx(done)
    told = rows(found, "processing", processor="chip", outcome="done")
    assert [row["time_s"] for row in told] == pytest.approx(done)
    assert not rows(found, "processing", processor="idle")


@covers("service_spread_s", of=("[processors]",))
def test_service_takes_up_to_its_spread_longer():
    radar = {**RADAR, "scan_rate_hz": 20, "processor": "chip"}
    chip = {"service_s": 0.01, "service_spread_s": 0.03}
    told = rows(run(scene(radar=radar, processors={"chip": chip}, duration_s=5)), "processing")
    times = [row["time_s"] - row["started_s"] for row in told]
    assert len(times) == 100
    assert 0.01 <= min(times) < 0.012 and 0.037 < max(times) <= 0.04
    assert sum(times) / 100 == pytest.approx(0.025, abs=0.003)


@covers("when_busy", of=("[processors]",))
@pytest.mark.parametrize(
    ("when_busy", "entered", "scans"),
    [
        # 0.4 s of work on what comes every 0.25 s.
        ("wait", [0, 0.25, 0.5, 0.75], 8),
        # At 0.4 s only the newest waits, and so on.
        ("drop_oldest", [0, 0.25, 0.75, 1.0], 8),
        ("skip", [0, 0.5, 1.0, 1.5], 4),
    ],
)
def test_who_comes_while_it_is_busy(when_busy, entered, scans):
    radar = {**RADAR, "processor": "chip"}
    chip = {"service_s": 0.4, "when_busy": when_busy}
    found = run(scene(radar=radar, processors={"chip": chip}))
    done = rows(found, "processing", outcome="done")
    assert [row["entered_s"] for row in done] == pytest.approx(entered)
    assert len(rows(found, "scans")) == scans
    rest = {"wait": set(), "drop_oldest": {"dropped"}, "skip": {"skipped"}}[when_busy]
    assert {row["outcome"] for row in rows(found, "processing")} == {"done"} | rest


@covers("update_rate_hz", of=("traffic.scripted",))
def test_positions_are_held_between_the_traffic_s_own_instants():
    found = scene()
    found["blocks"]["traffic"]["update_rate_hz"] = 2
    held = [row["true_range_m"] for row in rows(run(found))]
    moving = [row["true_range_m"] for row in rows(run(scene()))]
    assert held == pytest.approx([moving[k - k % 2] for k in range(8)])
    assert moving[1] != pytest.approx(moving[0], abs=1.0)
