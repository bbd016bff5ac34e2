"""``[[changes]]``: two runs glued at an instant, in any window, and beside other runs."""

from fractions import Fraction

import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des
from dsa_des.cli import main
from dsa_des.costs.variants import Variants
from dsa_des.errors import SceneError
from dsa_des.files.toml_files import to_toml
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.running.simulation import Simulation
from dsa_des.time.changing_clock import ChangingClock
from dsa_des.time.clock import ClockSpec


def scene(*changes, tracks=False, **keys):
    """Return a radar behind a gate, heard of by a fusion that hands everything on."""
    tables = {
        "title": "changes",
        "duration_s": 40,
        "seed": 3,
        "wires": ["traffic -> transform -> gate", "gate -> radar", "radar -> fusion"],
        "blocks": {
            "traffic": {
                "type": "traffic.scripted",
                "ownship": {
                    "lat_deg": 52, "lon_deg": 4, "alt_m": 900, "heading_deg": 0, "speed_mps": 60
                },
                "intruders": [
                    {"name": f"i{n}", "east_m": 900 * n, "north_m": 5000, "up_m": 0,
                     "heading_deg": 180 + 20 * n, "speed_mps": 70, "rcs_dbsm": 0}
                    for n in range(3)
                ],
            },
            "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"},
            "radar": {
                "type": "radar.swerling", "scan_rate_hz": 2, "range_km": 12, "power_w": 8,
                "antenna_gain_db": 28, "wavelength_m": 0.03, "noise_figure_db": 5,
                "losses_db": 8, "bandwidth_hz": 1e5, "swerling": 1, "azimuth_resolution_deg": 1,
                "elevation_resolution_deg": 1, "range_resolution_m": 30, "errors": "stated",
                "azimuth_error_deg": 0.3, "elevation_error_deg": 0.3, "range_error_m": 20,
            },
            "fusion": {"type": "fusion.pass_through"},
        },
    }  # fmt: skip
    if changes:
        tables["changes"] = list(changes)
    if tracks:
        tables["blocks"] |= TRACKING
        tables["wires"] += ["fusion -> tracker", "traffic -> alerting.states",
                            "tracker -> alerting.estimates"]  # fmt: skip
    return dsa_des.load_scene({**tables, **keys})


TRACKING = {
    "tracker": {"type": "tracking.ekf", "delete_after_s": 20},
    "alerting": {"type": "alerting.daidalus", "scan_rate_hz": 1, "conf": "do365b.conf"},
}


def change(key, value, **when):
    return {**(when or {"from_s": 13, "to_s": 27}), "set": {key: value}}


#: What it was, counted only to spare work: a reach that changes is looked after in all stretches.
SPARED = {"evaluated"}


def rows_of(table, inside):
    """Return the rows of a recorded table at some instants, without counts of spared work."""
    spared = [n for n in table.column_names if n in SPARED or n.startswith("skipped")]
    kept = inside(table["time_s"].to_numpy())
    return table.drop_columns(spared).filter(pa.array(kept)).combine_chunks()


def glued(one, other, inside):
    """Return the tables of a run, with those of another one inside some stretch of time."""
    parts = {}
    for name, table in one.items():
        rows = [
            rows_of(table, lambda t: ~inside(t) & (t < 13)),
            rows_of(other[name], inside),
            rows_of(table, lambda t: ~inside(t) & (t >= 13)),
        ]
        parts[name] = pa.concat_tables(rows).combine_chunks()
    return parts


def inside(time_s):
    return (time_s >= 13) & (time_s < 27)


@covers("changes", of=("[scene]",))
@covers("from_s", "to_s", "set", of=("[changes]",))
@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("blocks.radar.enabled", False),
        ("blocks.radar.range_km", 2),
        ("blocks.radar.power_w", 0.4),
        ("blocks.radar.losses_db", 14),
        ("blocks.radar.azimuth_error_deg", 2),
        ("blocks.radar.false_alarm_probability", 1e-3),
        ("weather.rain_rate_mm_h", 60),
        ("wires[2].drop_probability", 0.6),
    ],
)
def test_a_change_gives_two_runs_glued_at_its_instants(key, value):
    _, before = tables_of(scene())
    _, other = tables_of(scene().set({key: value}))
    changed = same_in_any_window(scene(change(key, value)), windows=(1, 9))
    expected = glued(before, other, inside)
    assert changed.keys() >= expected.keys()
    differs = 0
    for name, table in expected.items():
        got = rows_of(changed[name], lambda t: t >= 0)
        assert got.equals(table), name
        differs += not got.equals(rows_of(before[name], lambda t: t >= 0))
    assert differs  # and it is a change at all


def scans_of(table):
    return np.round(table["time_s"].to_numpy(), 9).tolist()


@covers("at_s", of=("[changes]",))
def test_a_clock_of_a_new_rate_counts_from_the_change_on():
    key = "blocks.radar.scan_rate_hz"
    lasts = scene(change(key, 4, at_s=1.1), {"at_s": 2, "set": {key: 0.5}}, duration_s=7)
    whole = same_in_any_window(lasts, windows=(1, 3))
    expected = [0, 0.5, 1, 1.1, 1.35, 1.6, 1.85, 2, 4, 6]
    assert scans_of(whole["scans"]) == expected
    assert whole["scans"]["scan"].to_pylist() == list(range(10))


def test_a_clock_that_drifts_goes_on_from_its_last_scan():
    drifts = scene(change("blocks.radar.rate_error_ppm", 250_000, at_s=1.2), duration_s=4)
    whole = same_in_any_window(drifts, windows=(1, 3))
    # 0.5 s as it reads are 0.4 s.
    assert scans_of(whole["scans"]) == [0, 0.5, 1, 1.5, 1.9, 2.3, 2.7, 3.1, 3.5, 3.9]


def test_a_clock_jumps_by_what_its_offset_changes():
    jumps = scene(change("blocks.radar.offset_s", 0.2, from_s=1.2, to_s=2.4), duration_s=4)
    whole = same_in_any_window(jumps, windows=(1, 3))
    assert scans_of(whole["scans"]) == [0, 0.5, 1, 1.7, 2.2, 2.5, 3, 3.5]


def test_jitter_stays_in_its_stretch_and_its_order():
    jitters = scene(change("blocks.radar.jitter_s", 0.1, from_s=10.25, to_s=20.25), duration_s=30)
    time_s = same_in_any_window(jitters, windows=(1, 5))["scans"]["time_s"].to_numpy()
    whole = np.arange(60) / 2
    moved = np.abs(time_s - whole)
    inside = (whole >= 10.25) & (whole < 20.25)
    assert (moved[~inside] < 1e-9).all()
    assert moved[inside].mean() == pytest.approx(0.1 * np.sqrt(2 / np.pi), rel=0.6)
    assert (np.diff(time_s) > 0).all()
    assert ((time_s[inside] >= 10.25) & (time_s[inside] < 20.25)).all()


def test_jitter_does_not_move_a_scan_over_the_border_of_its_stretch():
    # All draws are as early, or as late, as jitter gets: 0.45 periods of 500 ticks. Scans 21 to 40
    # on the grid, 10,500 to 20,000, are those of the stretch; its first and last would leave it.
    still, jitters = ClockSpec(Fraction(2)), ClockSpec(Fraction(2), jitter_s=1.0)
    for draw, moved in ((-9.0, -225), (9.0, 225)):
        clock = ChangingClock(
            still, [(10_450, jitters), (20_050, still)], 1000, lambda k, d=draw: np.full(len(k), d)
        )
        expected = np.arange(0, 30_000, 500)
        expected[21:41] += moved
        expected[21], expected[40] = max(expected[21], 10_450), min(expected[40], 20_049)
        assert clock.ticks(np.arange(60)).tolist() == expected.tolist()
        assert clock.scans_between(10_450, 20_050)[0].tolist() == list(range(21, 41))


def test_what_is_remembered_goes_on_in_any_window_and_beside_other_runs():
    changes = [
        change("blocks.radar.range_error_m", 60, from_s=8, to_s=12),
        change("blocks.radar.enabled", False, from_s=14, to_s=19),
        change("blocks.tracker.gate_probability", 0.9, at_s=21),
        change("wires[2].delay_s", 0.3, from_s=15, to_s=30),
        change("weather.rain_rate_mm_h", 10, at_s=25),
        change("blocks.alerting.scan_rate_hz", 2, at_s=26),
    ]
    loaded = scene(*changes, tracks=True)
    whole = same_in_any_window(loaded, windows=(1, 4))
    simulation = same_as_alone(replicas_of(loaded, {}, {}, {}), window=40)
    assert simulation.runs.count == 3
    # The tracks of before the radar was off are there after it.
    time_s, number = (whole["state_tracks"][n].to_numpy() for n in ("time_s", "track"))
    off = (time_s > 14.3) & (time_s < 19)
    assert not off.any()
    assert set(number[time_s < 14.3]) & set(number[time_s > 19])
    at_halves = [t for t in scans_of(whole["alerts"]) if t % 1]
    assert min(at_halves) >= 26


def test_a_change_at_the_start_is_what_the_scene_begins_as():
    """What a block makes at its first wake is not there yet to go on from."""
    key = "blocks.radar.range_km"
    whole = same_in_any_window(scene(change(key, 4.5, at_s=0), tracks=True))
    begun = replica_scene(scene(tracks=True), Replica(3, {key: 4.5}))
    for name, table in tables_of(begun)[1].items():
        assert rows_of(whole[name], lambda t: t >= 0).equals(rows_of(table, lambda t: t >= 0)), name
    assert whole["alerts"].num_rows


def test_a_delay_that_changes_holds_for_what_is_made_from_then_on():
    late = scene(change("wires[2].delay_s", "1/4", at_s=3.2), tracks=True, duration_s=5)
    arrived = set(scans_of(same_in_any_window(late)["fused"]))
    assert arrived <= {0, 0.5, 1, 1.5, 2, 2.5, 3, 3.75, 4.25, 4.75}
    assert {3, 3.75} <= arrived


def test_a_delay_that_becomes_shorter_lets_messages_overtake():
    wires = ["traffic -> transform -> gate", "gate -> radar",
             {"from": "radar", "to": "fusion", "delay_s": 1.3}]  # fmt: skip
    overtakes = scene(change("wires[2].delay_s", 0.1, at_s=3), duration_s=6, wires=wires)
    arrived = set(scans_of(same_in_any_window(overtakes, windows=(1, 3))["fused"]))
    made = [scan / 2 + (0.1 if scan >= 6 else 1.3) for scan in range(12)]
    assert arrived <= set(np.round(made, 9))
    assert {2.8, 3.1, 3.6} <= arrived


WRONG = [
    ({"from_s": 1, "set": {"blocks.radar.enabled": False}}, "give at_s, for good, or from_s"),
    ({"at_s": 1, "to_s": 2, "set": {"blocks.radar.enabled": False}}, "says to_s and at_s"),
    ({"from_s": 3, "to_s": 2, "set": {"blocks.radar.enabled": False}}, "must be later than from_s"),
    ({"at_s": 41, "set": {"blocks.radar.enabled": False}}, "beyond the run's end, 40 s"),
    ({"from_s": 4, "to_s": 41, "set": {"blocks.radar.enabled": False}}, "beyond the run's end"),
    ({"at_s": 1, "set": {"blocks.radar.enabeld": False}}, "did you mean 'enabled'?"),
    ({"at_s": 1, "set": {"blocks.rader.enabled": False}}, "did you mean 'blocks.radar'?"),
    ({"at_s": 1, "set": {"blocks.radar.swerling": 3}}, "radar, a SwerlingRadar, can change others"),
    ({"at_s": 1, "set": {"blocks.traffic.ownship.alt_m": 3}}, "cannot change while a run lasts"),
    ({"at_s": 1, "set": {"weather.wind_mps": 3}}, "[weather] can change others"),
    ({"at_s": 1, "set": {"wires[2].holds": 3}}, "wires[2] can change others"),
    ({"at_s": 1, "set": {"wires[7].delay_s": 3}}, "the list has 3"),
    ({"at_s": 1, "set": {"duration_s": 3}}, "is no key of this scene that can change"),
    ({"at_s": 1, "sets": {"blocks.radar.range_km": 3}}, "did you mean 'set'?"),
    ({"at_s": 1, "set": {"blocks.radar.range_km": -3}}, "greater than 0"),
    ({"at_s": "x", "set": {"blocks.radar.range_km": 3}}, "must be a number"),
    ({"at_s": -1, "set": {"blocks.radar.range_km": 3}}, "must be 0 or greater"),
    ({"at_s": 1, "set": {}}, "must be a table of keys and values"),
    ({"at_s": 1, "set": {"wires[1].delay_s": 1}}, "runs on demand, ahead of scans by so much"),
]


@pytest.mark.parametrize(("entry", "said"), WRONG)
def test_what_cannot_change_is_said_with_what_can(entry, said):
    with pytest.raises(SceneError, match=r"changes") as wrong:
        Simulation(scene(entry))
    assert said in str(wrong.value)


def test_changes_of_one_key_must_not_overlap():
    first = change("blocks.radar.range_km", 3, from_s=2, to_s=8)
    for when in ({"at_s": 5}, {"from_s": 7, "to_s": 9}, {"from_s": 2, "to_s": 3}):
        with pytest.raises(SceneError, match=r"set by changes\[0\] too, from 2 s to 8 s"):
            scene(first, change("blocks.radar.range_km", 4, **when))
    # One after the other they may, and back to what holds for good.
    fits = scene(change("blocks.radar.range_km", 9, at_s=1), first,
                 change("blocks.radar.range_km", 4, from_s=8, to_s=10))  # fmt: skip
    ranges = [one.scene.blocks["radar"].parameters.range_km for one in fits.stretches]
    assert [one.from_s for one in fits.stretches] == [1, 2, 8, 10]
    assert ranges == [9, 3, 4, 9]


def test_a_run_folder_says_what_changed():
    changed = scene(change("blocks.radar.enabled", False, from_s="1/3", to_s=4))
    late = scene(change("wires[2].delay_s", 1, at_s=3), tracks=True)
    there = dsa_des.load_scene(late.resolved())
    assert there.stretches[0].scene.wires == late.stretches[0].scene.wires != late.wires
    again = dsa_des.load_scene(changed.resolved())
    assert again.stretches[0].from_s == Fraction(1, 3)
    assert [one.to_table() for one in again.changes] == [one.to_table() for one in changed.changes]


def test_a_run_prints_what_changes_when(tmp_path):
    path = tmp_path / "changes.toml"
    path.write_text(to_toml(scene(change("blocks.radar.enabled", False)).resolved()))
    words = ["run", str(path), "--out", str(tmp_path / "out"), "--no-figures"]
    printed = CliRunner().invoke(main, words, catch_exceptions=False).stdout
    assert "from 13 s to 27 s: blocks.radar.enabled = false\n" in printed


def test_costs_are_of_scenes_that_stay_as_they_are(tmp_path):
    path = tmp_path / "changes.toml"
    path.write_text(to_toml(scene(change("blocks.radar.enabled", False)).resolved()))
    with pytest.raises(SceneError, match="costs are of a scene that stays as it is"):
        Variants(path)
