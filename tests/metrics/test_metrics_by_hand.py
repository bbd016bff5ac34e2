"""Metrics on tables small enough to work out by hand, and on real runs one by one."""

import math
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from components.metrics.losses import (
    displacements_around,
    find_closest_approach,
    first_times_inside,
    flight_times_first_within_s,
    nearest_ranges_and_times,
)
from components.metrics.separation import Separation, range_horizontal_vertical_m, relative_flights
from components.well_clear.volume import PRESETS
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.message import Text
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.replicas import run_replicas
from dsa_des.scene.scene import load_scene
from dsa_des.studies.metric import METRICS, Group, needed_columns
from dsa_des.studies.study import MetricSpec

WELL_CLEAR_M, NMAC_M = (
    (PRESETS[name].horizontal_m, PRESETS[name].vertical_m) for name in ("astm_f3442", "nmac")
)
KINDS = {"block": str, "target": str, "sensors": str, "updated_by": str}


def table(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Recorded columns of some rows; ticks are nanoseconds."""
    names = dict.fromkeys(name for row in rows for name in row)
    columns: dict[str, Any] = {}
    for name in names:
        values = [row[name] for row in rows]
        if KINDS.get(name) is str:
            known = tuple(dict.fromkeys(v for v in values if v is not None))
            codes = np.array([-1 if v is None else known.index(v) for v in values])
            columns[name] = Text(codes, known)
        else:
            columns[name] = np.array(values)
    columns["tick"] = np.round(columns["time_s"] * 1e9).astype(np.int64)
    return columns


def look(time_s: float, scan: int, range_m: float, target: str | None = "one",
         block: str = "radar") -> dict[str, Any]:  # fmt: skip
    return {"block": block, "target": target, "time_s": time_s, "scan": scan,
            "true_range_m": range_m, "declared": target is not None}  # fmt: skip


def fused(time_s: float, sensors: str, target: str = "one") -> dict[str, Any]:
    return {"block": "fusion", "target": target, "time_s": time_s, "sensors": sensors,
            "true_range_m": 1000 - time_s}  # fmt: skip


def scans(block: str, period_s: float, looks: Sequence[int]) -> list[dict[str, Any]]:
    return [{"block": block, "time_s": period_s * k, "evaluated": n} for k, n in enumerate(looks)]


def track(time_s: float, measured_s: float, sensor: str = "radar") -> dict[str, Any]:
    return {"block": "tracker", "target": "one", "time_s": time_s, "measured_s": measured_s,
            "updated_by": sensor, "age_s": time_s - measured_s}  # fmt: skip


#: Four runs of 6 s: one with much in it, one of a single detection, one without any, and one whose
#: first scan sees somebody.
RUNS: list[dict[str, Any]] = [
    {
        "detections": table(
            [look(0.0, 0, 1.0, None), look(0.2, 1, 900), look(0.4, 2, 880),
             look(0.4, 2, 500, "two"),
             look(1.2, 6, 800), look(1.4, 7, 780), look(1.5, 3, 770, block="ir")]
        ),
        "fused": table([fused(0.2, "radar"), fused(0.4, "radar"), fused(1.4, "radar+ir")]),
        "scans": table([*scans("radar", 0.2, [0, 2, 2, 0, 0, 0, 2, 2]),
                        *scans("ir", 0.5, [1, 1, 1, 1])]),
        # Nothing new at 0.6 s, and another sensor's measurement of the same instant at 3.7 s.
        "tracks": table([track(0.2, 0.2), track(0.4, 0.4), track(0.6, 0.4), track(3.4, 3.4),
                         track(3.7, 3.4, "ir")]),
    },
    {
        "detections": table([look(3.0, 15, 700)]), "fused": table([fused(3.0, "radar")]),
        "scans": table([*scans("radar", 0.2, [1] * 16), *scans("ir", 0.5, [0] * 7)]),
        "tracks": table([track(3.0, 3.0)]),
    },
    {},
    {
        "detections": table([look(0.0, 0, 950), look(0.2, 1, 940)]),
        "fused": table([fused(0.0, "radar"), fused(2.0, "radar")]),
        "scans": table([*scans("radar", 0.2, [1, 1, 0]), *scans("ir", 0.5, [0, 0])]),
    },
]  # fmt: skip
NAN = math.nan
FIRST, RULE = "first_detection_", {"m": 2, "n": 2, "sensors": ["radar"]}
MEASURED: list[tuple[str, dict[str, Any], dict[str, list[Any]]]] = [
    ("first_detection", {}, {
        "detected.ir": [1, 0, 0, 0], f"{FIRST}time_s.ir": [1.5, NAN, NAN, NAN],
        f"{FIRST}range_m.ir": [770, NAN, NAN, NAN],
        f"{FIRST}cut_off.ir": [None, "never", "never", "never"],
        "detected.radar": [1, 1, 0, 1], f"{FIRST}time_s.radar": [0.2, 3, NAN, 0],
        f"{FIRST}range_m.radar": [900, 700, NAN, 950],
        f"{FIRST}cut_off.radar": [None, None, "never", "at the start"],
        "detected.fused": [1, 1, 0, 1], f"{FIRST}time_s.fused": [0.2, 3, NAN, 0],
        f"{FIRST}range_m.fused": [999.8, 997, NAN, 1000],
        f"{FIRST}cut_off.fused": [None, None, "never", "at the start"],
    }),
    ("first_detection", {"target": "two", "sensors": ["radar"]}, {
        "detected.radar": [1, 0, 0, 0], f"{FIRST}time_s.radar": [0.4, NAN, NAN, NAN],
        f"{FIRST}range_m.radar": [500, NAN, NAN, NAN],
        f"{FIRST}cut_off.radar": [None, "never", "never", "never"],
    }),
    ("detection_share", {}, {
        "detection_share.ir": [0.25, NAN, NAN, NAN], "detection_share.ir.trials": [4, 0, 0, 0],
        "detection_share.radar": [5 / 8, 1 / 16, NAN, 1],
        "detection_share.radar.trials": [8, 16, 0, 2],
    }),
    ("declaration", RULE, {
        f"{what}.{name}": values for name in ("radar", "any") for what, values in {
            "declared": [1, 0, 0, 1], "declaration_time_s": [0.4, NAN, NAN, 0.2],
            "declaration_range_m": [880, NAN, NAN, 940],
            "declaration_delay_s": [0.2, NAN, NAN, 0.2],
            "declaration_cut_off": [None, "never", "never", "at the start"],
        }.items()
    }),
    # The camera's detection comes after the fused row; of the radar's one of five is in it.
    ("fused_share", {}, {
        "fused_share.ir_with_radar": [0, NAN, NAN, NAN],
        "fused_share.ir_with_radar.trials": [1, 0, 0, 0],
        "fused_share.radar_with_ir": [1 / 5, 0, NAN, 0],
        "fused_share.radar_with_ir.trials": [5, 1, 0, 2],
    }),
    # Ages rise to 0.2 in 0.2 s and to 1 in 1 s; for 5 % of 1.2 s they are above 0.94 s.
    ("age_of_information", {}, {
        "age_of_information_mean_s": [(0.02 + 0.5) / 1.2, NAN, NAN, 1],
        "age_of_information_p95_s": [0.94, NAN, NAN, 1.9],
    }),
    # Updates 0.2, 3 and 0.3 s apart: 1 s of 3.5 s is more than 2 s after one.
    ("track_updates", {}, {
        "track_update_interval_s": [3.5 / 3, NAN, NAN, NAN],
        "track_update_interval_p95_s": [3, NAN, NAN, NAN],
        "track_continuity": [1 - 1 / 3.5, NAN, NAN, NAN], "track_breaks": [1, 0, NAN, NAN],
    }),
    ("track_updates", {"break_after_s": 0.25}, {
        "track_update_interval_s": [3.5 / 3, NAN, NAN, NAN],
        "track_update_interval_p95_s": [3, NAN, NAN, NAN],
        "track_continuity": [1 - 2.8 / 3.5, NAN, NAN, NAN], "track_breaks": [2, 0, NAN, NAN],
    }),
]  # fmt: skip


@pytest.mark.parametrize(("name", "keys", "wanted"), MEASURED)
def test_what_is_measured_of_recorded_rows_is_as_by_hand(
    small: Path, name: str, keys: dict[str, Any], wanted: dict[str, list[Any]]
) -> None:
    scene = load_scene("small.toml")
    metric = MetricSpec(name, keys).build(scene)
    runs: list[Any] = [
        SimpleNamespace(duration_s=6.0, ended_early=False, shared=None, number=k, tables=tables)
        for k, tables in enumerate(RUNS)
    ]
    replicas = [Replica(k) for k in range(len(runs))]
    found = metric.measure(Group(scene, replicas, runs, needed_columns([metric])))
    assert found.keys() == wanted.keys()
    for key, values in wanted.items():
        if found[key].dtype == object:
            assert found[key].tolist() == values, key
        else:
            np.testing.assert_allclose(found[key], np.array(values, dtype=float), err_msg=key)


def test_flights_together_are_as_each_alone(small: Path) -> None:
    """Runs of other lengths and starts: the nearest of all times, and the begin of a loss."""
    flights = []
    for k, (north_m, until_s) in enumerate([(5000, 60), (4321.5, 48.37), (900, 20), (-3000, 35)]):
        sets = (f"blocks.traffic.intruders[0].north_m={north_m}",)
        scene = load_scene("small.toml", sets=sets, duration_s=until_s)
        flights += relative_flights(scene, None if k < 3 else 0.5)
    range_m, time_s = nearest_ranges_and_times(flights)
    alone = [find_closest_approach(flight)[:2] for flight in flights]
    assert list(zip(range_m.tolist(), time_s.tolist(), strict=True)) == alone
    found = flight_times_first_within_s(flights, WELL_CLEAR_M, NMAC_M)
    for flight, (lost_s, _) in zip(flights[:3], found.tolist(), strict=False):
        times = np.arange(0.0, flight.end_s, 1e-3)
        apart = flight.separation_at(times)
        inside = (apart.horizontal_m < WELL_CLEAR_M[0]) & (apart.vertical_m < WELL_CLEAR_M[1])
        assert lost_s == pytest.approx(times[np.argmax(inside)], abs=2e-3)
    assert np.isnan(found[3]).all()
    own, target = displacements_around(flights, np.minimum(time_s, 10.0), 0.5)
    # North and east of an ownship that meets its targets; the last is looked at from time 0 on.
    wanted = np.array([[50, 50, 50, 25], [0, 0, 0, 0]])
    np.testing.assert_allclose(own, wanted, atol=0.01)
    np.testing.assert_allclose(target, -1.2 * wanted, atol=0.01)


def test_distances_of_f3442_are_exclusive() -> None:
    assert pytest.approx((609.6, 76.2)) == WELL_CLEAR_M and pytest.approx((152.4, 30.48)) == NMAC_M
    inside = Separation("x", np.arange(3.0), np.full(3, 700.0), np.array([609.6, 609.5, 0.0]),
                        np.array([0.0, 76.2, 76.1]))  # fmt: skip
    flight = SimpleNamespace(separations_by_piece=lambda: iter([inside]), between_samples=False)
    lost, never = first_times_inside(flight, WELL_CLEAR_M, (1.0, 0.5))
    assert lost == 2.0
    assert np.isnan(never)


def test_a_loss_of_the_smaller_volume_is_looked_for_after_that_of_the_larger() -> None:
    """In whichever piece of the flight it comes; and the first time counts, not a later one."""
    pieces = [
        Separation("x", 2.0 * k + np.arange(2.0), far_m, far_m, np.zeros(2))
        for k, far_m in enumerate(np.array([[900.0, 600.0], [500.0, 400.0], [150.0, 140.0]]))
    ]
    flight = SimpleNamespace(separations_by_piece=lambda: iter(pieces), between_samples=False)
    assert first_times_inside(flight, WELL_CLEAR_M, NMAC_M) == [1.0, 4.0]
    assert first_times_inside(flight, NMAC_M, WELL_CLEAR_M) == [4.0, 1.0]


def test_distances_do_not_depend_on_the_pieces_they_come_in(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load_scene("small.toml", duration_s=60)

    def found() -> tuple[Any, ...]:
        (flight,) = relative_flights(scene, 0.13)
        time_s = np.concatenate([piece.time_s for piece in flight.separations_by_piece()])
        return (
            time_s.tolist(),
            find_closest_approach(flight),
            first_times_inside(flight, WELL_CLEAR_M, NMAC_M),
        )

    whole = found()
    assert len(whole[0]) > 1000  # the grid and the samples of the source
    assert np.all(np.diff(whole[0]) > 0)
    for pieces in (50, 301):
        monkeypatch.setattr("components.metrics.separation.MOST_AT_ONCE", pieces)
        assert found() == whole


def with_alerts(folder: Path) -> str:
    """The small scene with a block that alerts of the truth."""
    text = (folder / "small.toml").read_text(encoding="utf-8")
    conf = Path(__file__).parents[2] / "configs" / "alerting" / "do365b.conf"
    text = text.replace("wires = [", 'wires = [ "traffic -> alarm",', 1)
    text += f'\n[blocks.alarm]\ntype = "alerting.daidalus"\nscan_rate_hz = 4\nconf = "{conf}"\n'
    (folder / "alarm.toml").write_text(text, encoding="utf-8")
    return "alarm.toml"


def with_avoidance(folder: Path) -> str:
    """The small scene with a block that alerts of tracks and one that steers the ownship."""
    text = (folder / with_alerts(folder)).read_text(encoding="utf-8")
    back = '{ from = "avoidance", to = "traffic", delay_s = 0.5, holds = "nothing" }'
    text = text.replace("wires = [", f'wires = [ "tracker -> alarm -> avoidance", {back},', 1)
    conf = Path(__file__).parents[2] / "configs" / "alerting" / "do365b.conf"
    text += f'\n[blocks.avoidance]\ntype = "avoidance.daidalus"\nconf = "{conf}"\n'
    (folder / "avoidance.toml").write_text(text, encoding="utf-8")
    return "avoidance.toml"


def with_estimates(folder: Path) -> str:
    """The small scene with a tracker that estimates states."""
    text = (folder / "small.toml").read_text(encoding="utf-8")
    for old, new in (
        ("fusion.pick_best", "fusion.pass_through"),
        ("tracking.stub", "tracking.ekf"),
    ):
        assert old in text
        text = text.replace(old, new)
    grid = "azimuth_resolution_deg = 0.5\nelevation_resolution_deg = 0.5\nrange_resolution_m = 20\n"
    text = text.replace("reach_km =", f"{grid}reach_km =")
    (folder / "estimates.toml").write_text(text, encoding="utf-8")
    return "estimates.toml"


# Of traffic and loops that the small scene has not; tests/encounters and tests/metrics have them.
ELSEWHERE = {"encounter_weight", "mitigated", "risk_ratio"}
# Of blocks that the small scene has not.
OF_OTHERS = {
    "alert_times": with_alerts,
    "manoeuvres": with_avoidance,
    "track_errors_by_range": with_estimates,
    "tracking": with_estimates,
}
# Of times and places that the small scene has: 6 s, from 2.7 nautical miles on.
KEYS = {"track_errors_by_range": {"from_s": 1.0, "ranges_nmi": [2.4, 2.6]}}


@pytest.mark.parametrize("name", sorted(entry_points_of(METRICS).keys() - ELSEWHERE))
def test_a_group_measures_what_its_runs_measure_alone(small: Path, name: str) -> None:
    scene = load_scene(OF_OTHERS[name](small) if name in OF_OTHERS else "small.toml")
    metric = MetricSpec(name, KEYS.get(name, {})).build(scene)
    wanted = needed_columns([metric])
    replicas = [
        Replica(k, {"blocks.traffic.intruders[0].east_m": 60.0 * k, "blocks.ir.offset_s": k / 16})
        for k in range(5)
    ]
    runs: list[Any] = run_replicas(scene, replicas, wanted=wanted)
    together = metric.measure(Group(scene, replicas, runs, wanted))
    names = {result.name for result in metric.results()}
    assert names <= set(together)
    for k, (replica, run) in enumerate(zip(replicas, runs, strict=True)):
        alone = metric.measure(Group(scene, [replica], [run], wanted))
        for key, values in together.items():
            if values.dtype == object:
                assert values[k : k + 1].tolist() == alone[key].tolist(), key
            else:
                assert values[k : k + 1].tobytes() == alone[key].astype(values.dtype).tobytes(), key
    numbers = [values for values in together.values() if values.dtype != object]
    assert any(np.isfinite(values).any() for values in numbers)


def test_an_old_detection_that_comes_late_makes_nothing_older(small: Path) -> None:
    """The radar is heard 0.9 s late, between two looks of the IR that has none: its age counts.

    So the age goes from 0 to 0.5 s between the IR's looks at 0, 0.5, ... 5.5 s.
    """
    text = Path("small.toml").read_text()
    late = '{ from = "radar", to = "fusion", delay_s = 0.9 }'
    for old, new in (
        ('"radar -> fusion"', late), ("fragile:Fragile", "radar.range_boundary"),
        ("reach_km = 4.8", "reach_km = 9"), ("reach_km", "range_km"),
        ("scan_rate_hz = 5\n", "scan_rate_hz = 1\noffset_s = 0.2\n"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    Path("late.toml").write_text(text)
    scene = load_scene("late.toml")
    metric = MetricSpec("age_of_information").build(scene)
    recorded = run_replicas(scene, [Replica(1)], wanted=needed_columns([metric]))
    found = metric.measure(Group(scene, [Replica(1)], recorded, needed_columns([metric])))
    assert found["age_of_information_mean_s"] == pytest.approx([0.25])
    assert found["age_of_information_p95_s"] == pytest.approx([0.475])


def test_distances_are_there_only_where_both_are():
    there = np.array([[True, True, False, False], [True, False, True, False]])
    own, other = (
        SimpleNamespace(lat_deg=np.full(4, 0.0), lon_deg=np.full(4, east), alt_m=np.full(4, up),
                        present=present)
        for east, up, present in zip((0.0, 1e-3), (400.0, 100.0), there, strict=True)
    )  # fmt: skip
    slant, level, height = range_horizontal_vertical_m(own, other)
    # On the equator, a thousandth of a degree of a circle of 6,378,137 m and some 250 m.
    chord = (6378137.0 + 250.0) * math.radians(1e-3)
    for found, wanted in ((slant, math.hypot(chord, 300.0)), (level, chord), (height, 300.0)):
        assert found[0] == pytest.approx(wanted, rel=1e-4)
        assert found[1:].tolist() == [math.inf] * 3
