"""Metrics on tables small enough to work out by hand, and on real runs one by one."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from components.metrics.losses import closest, first_inside, first_losses_s, nearest_of, ways_of
from components.metrics.separation import Separation, separations
from components.metrics.track_quality import _ramp_quantiles
from components.well_clear.volume import PRESETS
from dsa_des.block.entry_points import registered
from dsa_des.block.message import Text
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.replicas import Recorded, run_replicas
from dsa_des.scene.scene import load_scene
from dsa_des.studies.metric import METRICS, Group, wanted_by
from dsa_des.studies.study import MetricSpec

WELL_CLEAR_M, NMAC_M = (
    (PRESETS[name].horizontal_m, PRESETS[name].vertical_m) for name in ("astm_f3442", "nmac")
)
KINDS = {"block": str, "target": str, "sensors": str}


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


def measured(name: str, runs: list[dict[str, Any]], **keys: Any) -> dict[str, np.ndarray]:
    scene = load_scene("small.toml")
    metric = MetricSpec(name, keys).build(scene)
    recorded = [Recorded(tables, 10**9, 6.0, dict) for tables in runs]
    group = Group(scene, [Replica(k) for k in range(len(runs))], recorded, wanted_by([metric]))
    return dict(metric.measure(group))


def look(time_s: float, scan: int, range_m: float, target: str | None = "one",
         block: str = "radar") -> dict[str, Any]:  # fmt: skip
    return {"block": block, "target": target, "time_s": time_s, "scan": scan,
            "true_range_m": range_m, "declared": target is not None}  # fmt: skip


def fused(time_s: float, sensors: str, target: str = "one") -> dict[str, Any]:
    return {"block": "fusion", "target": target, "time_s": time_s, "sensors": sensors,
            "true_range_m": 1000 - time_s}  # fmt: skip


RUNS: list[dict[str, Any]] = [
    {
        "detections": table(
            [look(0.0, 0, 1.0, None), look(0.2, 1, 900), look(0.4, 2, 880),
             look(0.4, 2, 500, "two"),
             look(1.2, 6, 800), look(1.4, 7, 780), look(1.5, 3, 770, block="ir")]
        ),
        "fused": table([fused(0.2, "radar"), fused(0.4, "radar"), fused(1.4, "radar+ir")]),
    },
    {"detections": table([look(3.0, 15, 700)]), "fused": table([fused(3.0, "radar")])},
]  # fmt: skip


def test_first_detection(small: Path) -> None:
    found = measured("first_detection", RUNS)
    np.testing.assert_array_equal(found["first_detection_time_s.radar"], [0.2, 3.0])
    np.testing.assert_array_equal(found["first_detection_range_m.radar"], [900, 700])
    np.testing.assert_array_equal(found["detected.ir"], [1, 0])
    np.testing.assert_array_equal(found["first_detection_time_s.ir"], [1.5, np.nan])
    np.testing.assert_array_equal(found["first_detection_time_s.fused"], [0.2, 3.0])
    only = measured("first_detection", RUNS, target="two", sensors=["radar"])
    np.testing.assert_array_equal(only["first_detection_range_m.radar"], [500, np.nan])


@pytest.mark.parametrize(
    ("m", "n", "time_s"),
    [(1, 1, 0.2), (2, 2, 0.4), (2, 5, 0.4), (3, 5, np.nan), (3, 6, 1.2), (4, 7, 1.4),
     (4, 6, np.nan)],
)  # fmt: skip
def test_declaration_after_m_of_n(small: Path, m: int, n: int, time_s: float) -> None:
    found = measured("declaration", RUNS, m=m, n=n, target="one", sensors=["radar"])
    np.testing.assert_array_equal(
        found["declaration_time_s.radar"], [time_s, 3.0 if m == 1 else np.nan]
    )
    np.testing.assert_array_equal(found["declared.radar"], [time_s == time_s, m == 1])
    np.testing.assert_allclose(found["declaration_delay_s.radar"][0], time_s - 0.2)


def test_declaration_by_any_sensor_is_the_earliest(small: Path) -> None:
    found = measured("declaration", RUNS)
    np.testing.assert_array_equal(found["declaration_time_s.any"], [0.2, 3.0])
    np.testing.assert_array_equal(found["declaration_time_s.ir"], [1.5, np.nan])


def test_age_of_information(small: Path) -> None:
    # Arrivals at 0.2, 0.4 and 1.4 s: two ramps, 0 to 0.2 s and 0 to 1 s, over 1.2 s.
    found = measured("age_of_information", RUNS)
    np.testing.assert_allclose(
        found["age_of_information_mean_s"], [(0.02 + 0.5) / 1.2, np.nan], rtol=1e-12
    )
    np.testing.assert_allclose(found["age_of_information_p95_s"], [0.94, np.nan], rtol=1e-9)


def test_quantile_of_ramps_against_sampling() -> None:
    low, high = np.array([0.0, 0.1, 0.3]), np.array([0.5, 0.6, 0.4])
    ages = np.concatenate(
        [np.linspace(a, b, round((b - a) * 1_000_000)) for a, b in zip(low, high, strict=True)]
    )
    for share in (0.1, 0.5, 0.95):
        span = np.array([(high - low).sum()])
        found = _ramp_quantiles(np.zeros(3, dtype=np.int64), low, high, span, share)
        assert found[0] == pytest.approx(np.quantile(ages, share), abs=1e-5)


def test_track_updates_and_breaks(small: Path) -> None:
    times = [0.0, 1.0, 2.0, 7.0, 8.0]
    rows = [
        {"block": "tracker", "target": "one", "time_s": t, "age_s": 0.0, "true_range_m": 0}
        for t in times
    ]
    rows.insert(3, {**rows[0], "time_s": 5.0, "age_s": 3.0})  # held, not updated
    found = measured("track_updates", [{"tracks": table(rows)}], break_after_s=2.0)
    assert found["track_update_interval_s"][0] == 2.0
    assert found["track_update_interval_p95_s"][0] == 5.0
    assert found["track_breaks"][0] == 1.0
    assert found["track_continuity"][0] == 1 - 3 / 8


def test_position_error(small: Path) -> None:
    # 3 m to the side at 4 m, measured 4 m straight ahead of a target 5 m away.
    angle = np.arctan2(3, 4)
    row = {"block": "fusion", "target": "one", "time_s": 0.0, "azimuth_rad": 0.0,
           "elevation_rad": 0.0, "range_m": 4.0, "true_azimuth_rad": angle,
           "true_elevation_rad": 0.0, "true_range_m": 5.0}  # fmt: skip
    blind = {**row, "time_s": 1.0, "range_m": np.nan}
    found = measured("position_error", [{"fused": table([row, blind])}])
    assert found["fused_position_error_m"][0] == pytest.approx(3.0)
    assert found["fused_angle_error_deg"][0] == pytest.approx(np.degrees(angle))


def test_encounter_head_on(small: Path) -> None:
    scene = load_scene("small.toml", duration_s=60)
    (flight,) = separations(scene, 0.1)
    # 5 km apart, closing at 110 m/s, 100 m to the side and 10 m higher.
    range_m, time_s, cut_off = closest(flight)
    assert cut_off == ""
    assert time_s == pytest.approx(5000 / 110, abs=0.1)
    assert range_m == pytest.approx(np.hypot(100, 10), abs=0.6)
    lost, collision = first_inside(flight, WELL_CLEAR_M, NMAC_M)
    assert lost == pytest.approx((5000 - np.sqrt(609.6**2 - 100**2)) / 110, abs=0.15)
    assert collision > lost


def test_flights_together_are_as_each_alone(small: Path) -> None:
    """Runs of other lengths and starts: the nearest of all times, and the begin of a loss."""
    flights = []
    for k, (north_m, until_s) in enumerate([(5000, 60), (4321.5, 48.37), (900, 20), (-3000, 35)]):
        sets = (f"blocks.traffic.intruders[0].north_m={north_m}",)
        scene = load_scene("small.toml", sets=sets, duration_s=until_s)
        flights += separations(scene, None if k < 3 else 0.5)
    range_m, time_s = nearest_of(flights)
    alone = [closest(flight)[:2] for flight in flights]
    assert list(zip(range_m.tolist(), time_s.tolist(), strict=True)) == alone
    found = first_losses_s(flights, WELL_CLEAR_M, NMAC_M)
    for flight, (lost_s, _) in zip(flights[:3], found.tolist(), strict=False):
        times = np.arange(0.0, flight.end_s, 1e-3)
        apart = flight.at(times)
        inside = (apart.horizontal_m < WELL_CLEAR_M[0]) & (apart.vertical_m < WELL_CLEAR_M[1])
        assert lost_s == pytest.approx(times[np.argmax(inside)], abs=2e-3)
    assert np.isnan(found[3]).all()
    own, target = ways_of(flights, np.minimum(time_s, 10.0), 0.5)
    # North and east of an ownship that meets its targets; the last is looked at from time 0 on.
    wanted = np.array([[50, 50, 50, 25], [0, 0, 0, 0]])
    np.testing.assert_allclose(own, wanted, atol=0.01)
    np.testing.assert_allclose(target, -1.2 * wanted, atol=0.01)


def test_distances_of_f3442_are_exclusive() -> None:
    assert pytest.approx((609.6, 76.2)) == WELL_CLEAR_M and pytest.approx((152.4, 30.48)) == NMAC_M
    inside = Separation("x", np.arange(3.0), np.full(3, 700.0), np.array([609.6, 609.5, 0.0]),
                        np.array([0.0, 76.2, 76.1]))  # fmt: skip
    flight = SimpleNamespace(pieces=lambda: iter([inside]), between_samples=False)
    lost, never = first_inside(flight, WELL_CLEAR_M, (1.0, 0.5))
    assert lost == 2.0
    assert np.isnan(never)


def test_distances_do_not_depend_on_the_pieces_they_come_in(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load_scene("small.toml", duration_s=60)

    def found() -> tuple[Any, ...]:
        (flight,) = separations(scene, 0.13)
        time_s = np.concatenate([piece.time_s for piece in flight.pieces()])
        return time_s.tolist(), closest(flight), first_inside(flight, WELL_CLEAR_M, NMAC_M)

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


@pytest.mark.parametrize("name", sorted(registered(METRICS).keys() - ELSEWHERE))
def test_a_group_measures_what_its_runs_measure_alone(small: Path, name: str) -> None:
    scene = load_scene(OF_OTHERS[name](small) if name in OF_OTHERS else "small.toml")
    metric = MetricSpec(name, KEYS.get(name, {})).build(scene)
    wanted = wanted_by([metric])
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
    recorded = run_replicas(scene, [Replica(1)], wanted=wanted_by([metric]))
    found = metric.measure(Group(scene, [Replica(1)], recorded, wanted_by([metric])))
    assert found["age_of_information_mean_s"] == pytest.approx([0.25])
    assert found["age_of_information_p95_s"] == pytest.approx([0.475])
