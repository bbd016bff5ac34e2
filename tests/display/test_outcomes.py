"""Tracks, alerts and manoeuvres of summaries, against tables by hand and the recorded ones."""

import numpy as np
import pyarrow.parquet as pq
import pymap3d
import pytest

import dsa_des
from components.display.outcomes import AlertSummary, ManoeuvreSummary, TrackSummary
from components.messages.state_tracks import STATUSES
from dsa_des.block.message import Text
from dsa_des.running.recorded_run import record_run
from tests.display.test_summary import TARGETS, text

ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")


@pytest.fixture(scope="module")
def crossing(tmp_path_factory, configs):
    folder = tmp_path_factory.mktemp("crossing") / "run"
    scene = dsa_des.load_scene(
        configs / "avoidance/crossing_tracked.toml",
        sets=[
            "blocks.pilot.held_s=0",
            "blocks.pilot.initial_delay_s=1",
            "blocks.pilot.coordination_s=0",
        ],
        duration_s="34",
    )
    return folder, record_run(scene, folder, draw=False)


def test_errors_of_tracks_are_those_by_pymap3d(crossing):
    folder, summary = crossing
    tracks = pq.read_table(folder / "state_tracks.parquet").to_pylist()
    held = [row for row in tracks if row["track_status"] in ("confirmed", "coasted")]
    told = summary["tracks"]["tracker"]
    assert told["confirmed"] == len({row["track"] for row in held}) > 0
    truth = {
        round(row["time_s"], 6): row
        for row in pq.read_table(folder / "truth.parquet").to_pylist()
        if row["target"] is not None
    }
    apart = {}
    for row in held:
        there = truth[round(row["state_s"], 6)]
        north, east, down = pymap3d.geodetic2ned(
            there["lat_deg"], there["lon_deg"], there["alt_m"],
            row["origin_lat_deg"], row["origin_lon_deg"], row["origin_alt_m"],
        )  # fmt: skip
        place = [row["north_m"] - north, row["east_m"] - east, row["down_m"] - down]
        apart.setdefault(row["track"], []).append(np.linalg.norm(place))
    near = np.concatenate(list(apart.values()))
    near = near[near < 300.0]
    assert told["position_error_m"] == pytest.approx(np.sqrt(np.mean(near**2)), rel=1e-6)
    assert told["false"] == sum(min(values) >= 300.0 for values in apart.values())


class Still:
    """Targets that stay where they are: 0, 0, 0 and 1000 m north of it, the second until 5 s."""

    names = ("a", "b")

    def positions_at(self, time_s):
        place = np.zeros((2, 3, len(time_s)))
        place[1, 0] = np.where(time_s < 5.0, 1000.0, np.nan)
        return place


def test_who_never_comes_near_a_target_is_false():
    rows = [
        # number, status, range, instant, north: the rms of 3, 4 and 12 m is 7.5 m
        (1, "tentative", True, 1.0, 0.0), (1, "confirmed", True, 2.0, 3.0),
        (1, "coasted", True, 3.0, 4.0), (2, "confirmed", True, 1.0, 988.0),
        (2, "confirmed", True, 6.0, 988.0), (3, "confirmed", True, 6.0, 988.0),
        (4, "confirmed", False, 1.0, np.nan), (5, "deleted", True, 1.0, 500.0),
    ]  # fmt: skip
    columns = {
        "block": Text(np.zeros(len(rows), dtype=np.int32), ("t",)),
        "track": np.array([row[0] for row in rows]),
        "track_status": Text(np.array([STATUSES.index(row[1]) for row in rows]), STATUSES),
        "has_range": np.array([row[2] for row in rows]),
        "state_s": np.array([row[3] for row in rows]),
        "north_m": np.array([row[4] for row in rows]),
        "time_s": np.array([row[3] + 0.5 for row in rows]),
        **{name: np.zeros(len(rows)) for name in ("east_m", "down_m", "own_down_m", *ORIGIN)},
        "own_north_m": np.full(len(rows), 3.0),
        "own_east_m": np.full(len(rows), 4.0),
    }
    for pieces in (1, len(rows)):
        summary = TrackSummary(["t", "u"], lambda tracker, origin: Still())
        for part in np.array_split(np.arange(len(rows)), pieces):
            some = {
                name: Text(of.codes[part], of.names) if isinstance(of, Text) else of[part]
                for name, of in columns.items()
            }
            summary.update("state_tracks", some)
        assert summary.result()["tracks"] == {
            "t": {
                "confirmed": 4,
                "false": 1,
                "position_error_m": pytest.approx(7.505553),
                # Track 2, 985 m north and 4 m west of the ownship; track 4 has no range.
                "first_confirmed": {"time_s": 1.5, "range_m": pytest.approx(985.008122)},
                "targets": {
                    "a": {"time_s": 2.5, "range_m": 4.0},
                    "b": {"time_s": 1.5, "range_m": pytest.approx(985.008122)},
                },
            },
            "u": {
                "confirmed": 0,
                "false": None,
                "position_error_m": None,
                "first_confirmed": None,
                "targets": {},
            },
        }


def test_a_track_of_directions_alone_is_confirmed_at_no_range():
    summary = TrackSummary(["t"], lambda tracker, origin: Still())
    blank = {name: np.full(1, np.nan) for name in ("north_m", "east_m", "down_m")}
    summary.update("state_tracks", {
        "block": text(["t"], ("t",)), "track": np.array([7]), "has_range": np.array([False]),
        "track_status": text(["confirmed"], STATUSES), "time_s": np.array([3.0]),
        **blank, **{f"own_{name}": np.zeros(1) for name in blank},
    })  # fmt: skip
    found = summary.result()["tracks"]["t"]
    assert found["first_confirmed"] == {"time_s": 3.0, "range_m": None}
    assert found["targets"] == {}


def test_first_alerts_and_manoeuvres_are_the_recorded_ones(crossing):
    folder, summary = crossing
    alerts = pq.read_table(folder / "alerts.parquet").to_pylist()
    for block, levels in summary["alerts"].items():
        mine = [row for row in alerts if row["block"] == block and row["level"] > 0]
        assert sorted(levels) == sorted({str(row["level"]) for row in mine}) != []
        for level, found in levels.items():
            times = [row["time_s"] for row in mine if str(row["level"]) == level]
            assert (found["first_s"], found["last_s"]) == (min(times), max(times))
    assert summary["alerts_of"] == {"alerting": ["tracker"], "true_alerting": ["the truth"]}
    flown = pq.read_table(folder / "manoeuvres.parquet")["time_s"].to_pylist()
    assert summary["manoeuvres"]["pilot"] == {
        "count": len(flown), "first_s": flown[0], "last_s": flown[-1]
    }  # fmt: skip


def test_a_target_is_first_confirmed_when_its_first_near_track_is_at_the_true_range(crossing):
    folder, summary = crossing
    found = summary["tracks"]["tracker"]
    tracks = pq.read_table(folder / "state_tracks.parquet").to_pylist()
    began_s = min(row["time_s"] for row in tracks if row["track_status"] == "confirmed")
    assert found["first_confirmed"]["time_s"] == began_s
    (name,) = found["targets"]
    truth = pq.read_table(folder / "truth.parquet").to_pylist()
    state_s = next(row["state_s"] for row in tracks if row["time_s"] == began_s)
    there = [row for row in truth if abs(row["time_s"] - state_s) < 1e-6]
    own = next(row for row in there if row["target"] is None)
    other = next(row for row in there if row["target"] == name)
    _, _, range_m = pymap3d.geodetic2aer(
        *(other[key] for key in ("lat_deg", "lon_deg", "alt_m")),
        *(own[key] for key in ("lat_deg", "lon_deg", "alt_m")),
    )
    assert found["targets"][name]["range_m"] == pytest.approx(range_m, abs=100.0)


def test_alerts_come_piece_by_piece_and_keep_each_level_and_target():
    rows = [  # block, time, target, level
        ("x", 1.0, "a", 1), ("x", 1.0, "b", 0), ("x", 2.0, "a", 2), ("x", 2.0, "b", 1),
        ("y", 2.0, None, 1), ("x", 5.0, "a", 1), ("x", 6.0, "b", 1),
    ]  # fmt: skip
    for cuts in ([], [1], [2, 4], range(1, 7)):
        summary = AlertSummary({"x": ["ekf"], "y": ["the truth"], "z": ["a", "b"]})
        for part in np.split(np.arange(len(rows)), cuts):
            some = [rows[row] for row in part]
            summary.update("alerts", {
                "block": text([row[0] for row in some], ("x", "y")),
                "time_s": np.array([row[1] for row in some]),
                "target": text([row[2] for row in some], TARGETS),
                "level": np.array([row[3] for row in some]),
            })  # fmt: skip
        spans = {
            name: {"first_s": first_s, "last_s": last_s}
            for name, first_s, last_s in (("a", 1.0, 5.0), ("b", 2.0, 6.0), ("a2", 2.0, 2.0))
        }
        assert summary.result()["alerts"] == {
            "x": {
                "1": {"first_s": 1.0, "last_s": 6.0,
                      "targets": {"a": spans["a"], "b": spans["b"]}},
                "2": spans["a2"] | {"targets": {"a": spans["a2"]}},
            },
            "y": {"1": spans["a2"] | {"targets": {"no target": spans["a2"]}}},
            "z": {},
        }  # fmt: skip


def test_manoeuvres_come_piece_by_piece():
    summary = ManoeuvreSummary(["a", "b"])
    for codes, times_s in (([0, 1, 0], [1.0, 2.0, 3.0]), ([0, 0], [5.0, 8.0])):
        block = Text(np.array(codes), ("a", "b"))
        summary.update("manoeuvres", {"block": block, "time_s": np.array(times_s)})
    assert summary.result()["manoeuvres"] == {
        "a": {"count": 4, "first_s": 1.0, "last_s": 8.0},
        "b": {"count": 1, "first_s": 2.0, "last_s": 2.0},
    }


def test_without_recorded_truth_nothing_is_said_of_it_and_without_such_blocks_nothing(configs):
    scene = configs / "avoidance/crossing_tracked.toml"
    summary = dsa_des.run(dsa_des.load_scene(scene, sets=["record.truth=false"], duration_s="5"))
    found = summary.summary["tracks"]["tracker"]
    assert list(found) == ["confirmed", "first_confirmed"] and found["confirmed"] == 1
    assert found["first_confirmed"]["range_m"] > 0
    plain = dsa_des.run(dsa_des.load_scene(configs / "first_light.toml", duration_s="1")).summary
    assert {"tracks", "alerts", "manoeuvres"}.isdisjoint(plain)
