"""A transponder fails or begins in the middle of a run: what cooperative sensors make of it."""

import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des
from dsa_des.errors import SceneError
from tests.stretches.test_changes_while_a_run_lasts import change, glued, inside, rows_of

#: Whom a key means, and what they carry.
CRAFTS = {"a": {"mode_s": True, "ads_b": {"nacp": 9, "nacv": 2, "latency_s": 0.3}},
          "b": {"mode_c": True}, "c": {"mode_s": True, "ads_b": {"nacp": 8}}}  # fmt: skip
HEARS = {"azimuth_deg": [-180, 180], "elevation_deg": [-60, 60]}
ADS_B = {"type": "surveillance.ads_b", **HEARS}
TCAS = {"type": "surveillance.active", "far_every": 1, **HEARS}


def scene(sensor, *changes, of=None, **keys):
    """Return a scene of three that come nearer, banked, south of the equator."""
    crafts = CRAFTS | (of or {})
    tables = {
        "title": "equipage", "duration_s": 40, "seed": 3, "record": {"looks": True},
        "wires": ["traffic -> transform -> gate -> sensor"],
        "blocks": {
            "traffic": {
                "type": "traffic.scripted",
                "ownship": {"lat_deg": -41, "lon_deg": 175, "alt_m": 900, "heading_deg": 217,
                            "speed_mps": 60, "roll_deg": 20},
                "intruders": [
                    {"name": name, "east_m": -900 * n - 1000, "north_m": -4000, "up_m": 50 * n,
                     "heading_deg": 30, "speed_mps": 70, **crafts[name]}
                    for n, name in enumerate(crafts)
                ],
            },
            "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"},
            "sensor": {"scan_rate_hz": 2, "latency_s": 0.1, **sensor},
        },
    }  # fmt: skip
    return dsa_des.load_scene({**tables, **({"changes": list(changes)} if changes else {}), **keys})


def key(name, rest):
    return f"blocks.traffic.intruders.{name}.{rest}"


@covers(*(f"intruders.{name}" for name in ("mode_s", "mode_c")), of=("traffic.scripted",))
@pytest.mark.parametrize(("name", "rest", "value"), [
    ("a", "mode_s", False), ("b", "mode_s", True), ("b", "mode_c", False),
])  # fmt: skip
def test_a_transponder_that_fails_or_begins_gives_two_runs_glued_there(name, rest, value):
    _, before = tables_of(scene(TCAS))
    _, other = tables_of(scene(TCAS, of={name: {**CRAFTS[name], rest: value}}))
    changed = same_in_any_window(scene(TCAS, change(key(name, rest), value)), windows=(9,))
    expected = glued(before, other, inside)
    for table, rows in expected.items():
        assert rows_of(changed[table], lambda t: t >= 0).equals(rows), table
    assert not expected["detections"].equals(before["detections"])


def test_broadcasts_end_with_the_last_that_was_sent_before():
    """A failure at an instant is a transmitter that is silent from then on."""
    ends = scene(ADS_B, change(key("a", "ads_b"), False, at_s=13.2), duration_s=20)
    silent = {**CRAFTS["a"], "ads_b": {**CRAFTS["a"]["ads_b"], "silent_after_s": 13.2}}
    _, expected = tables_of(scene(ADS_B, of={"a": silent}, duration_s=20))
    changed = same_in_any_window(ends, windows=(9,))
    assert {name: changed[name].equals(rows) for name, rows in expected.items()} == dict.fromkeys(
        expected, True
    )
    same_as_alone(replicas_of(ends, {}, {}), window=7)


def test_broadcasts_that_begin_are_those_that_were_there_all_along():
    ends, begins_s = 20, 8.2
    never = {"a": {"mode_s": True}}
    begins = change(key("a", "ads_b"), CRAFTS["a"]["ads_b"], at_s=begins_s)
    lasts = {"duration_s": ends}
    _, changed = tables_of(scene(ADS_B, begins, of=never, **lasts))
    _, always = tables_of(scene(ADS_B, **lasts))
    changed = changed["detections"]
    rows = changed.to_pydict()
    first_s = min(r for r, of in zip(rows["reported_s"], rows["target"], strict=True) if of == "a")
    assert begins_s <= first_s < begins_s + 1
    # Once velocities, too, are of after.
    late = [
        rows_of(table, lambda t: t >= begins_s + 4) for table in (changed, always["detections"])
    ]
    assert late[0].equals(late[1]) and late[0]["time_s"].to_numpy().max() > ends - 1


def test_a_category_that_changes_is_that_of_what_was_sent_then():
    worse = change(key("a", "ads_b.nacp"), 6, at_s=13.2)
    _, tables = tables_of(scene(ADS_B, worse))
    mine = [row for row in tables["detections"].to_pylist() if row["target"] == "a"]
    sent_s, nacp, variance = (
        np.array([row[name] for row in mine])
        for name in ("reported_s", "nacp", "range_variance_m2")
    )
    assert np.array_equal(nacp, np.where(sent_s < 13.2, 9, 6))
    assert variance[nacp == 6].min() > 9 * variance[nacp == 9].max()


def test_a_platform_of_its_own_hears_the_ownship_fail():
    more = {"tcas": {**TCAS, "scan_rate_hz": 2, "platform": "a"}}
    fails = change("blocks.traffic.ownship.mode_s", False)
    made = {
        "type": "traffic.scripted",
        "ownship": {"lat_deg": -41, "lon_deg": 175, "alt_m": 900, "mode_s": True, "name": "own"},
        "intruders": [{"name": "a", "east_m": 0, "north_m": 3000, "up_m": 0}],
    }
    blocks = {"traffic": made, "transform": {"type": "geometry.ellipsoid", "platform": "a"},
              "gate": {"type": "gate", "platform": "a"}, **more}  # fmt: skip
    loaded = scene(TCAS, fails, blocks=blocks, wires=["traffic -> transform -> gate -> tcas"])
    seen = tables_of(loaded)[1]["detections"]
    assert set(seen["target"].to_pylist()) == {"own"}
    time_s = seen["time_s"].to_numpy()
    assert not inside(time_s).any() and (time_s < 13).sum() > 15 and (time_s >= 27).sum() > 15


@pytest.mark.parametrize("sensor", [ADS_B, TCAS])
def test_where_nobody_else_flies_nobody_is_heard(sensor):
    alone = {**scene(sensor).resolved()["blocks"]}
    alone["traffic"] = {**alone["traffic"], "intruders": []}
    _, tables = tables_of(scene(sensor, blocks=alone, duration_s=3))
    assert tables["scans"].num_rows == 6 and tables["detections"].num_rows == 0


def test_what_else_of_an_aircraft_cannot_change_is_said():
    for rest, said in (
        ("speed_mps", "can change others; allowed: ads_b, mode_c, mode_s"),
        ("ads_c", "did you mean 'ads_b'"),
        ("ads_b.nacp", "less than or equal to 11"),
    ):
        with pytest.raises(SceneError) as wrong:
            scene(ADS_B, change(key("a", rest), 30, at_s=3))
        assert said in str(wrong.value), wrong.value
