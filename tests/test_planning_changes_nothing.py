"""What a scene does not call for can be built or not: nothing that is recorded changes."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from components.environment.tables import Weather
from components.radar.swerling import SwerlingParameters, SwerlingRadar
from dsa_des.block.component import Context
from dsa_des.errors import SceneError
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.recording import Recorder
from dsa_des.running.effects import WireFaults, plan_effects
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.time.randomness import Streams

CONFIGS = Path(__file__).parent.parent / "configs"
PARTS = ("aircraft", "encounters", "evidence", "obstacles", "sensors", "studies")
#: Chains and sets of intruders that other scenes extend; they cannot run by themselves.
UNFINISHED = {
    "detect_and_sense.toml",
    "systems/base.toml",
    "systems/two_intruders.toml",
    "thesis/one_radar.toml",
}
#: Some seconds each, because everything is simulated for ten thousand aircraft.
LARGE = ("benchmark/sparse.toml", "benchmark/ten_thousand.toml")
#: Filters and loops take seconds for a whole run; by then everything has been seen, s.
ENDS_S = {
    "avoidance/crossing.toml": 50,
    "avoidance/crossing_pilot.toml": 50,
    "avoidance/crossing_seen_late.toml": 110,
    "avoidance/crossing_tracked.toml": 55,
    "avoidance/crossing_tracked_late.toml": 105,
    "avoidance/looking_out.toml": 135,
    "avoidance/radar_and_camera.toml": 60,
    "benchmark/closed_loop_risk.toml": 60,
    "platforms/fleet_of_16.toml": 20,
    "tracking/do365_sensors.toml": 80,
    "operator/session.toml": 10,
    "optical/pictures.toml": 5,
    "published/degas.toml": 30,
    "published/degas_radar.toml": 60,
    "published/see_and_avoid.toml": 30,
    "systems/afrl_tracked.toml": 15,
    "tracking/architectures.toml": 10,
    "tracking/cueing.toml": 14,
    "tracking/flown_intercept.toml": 20,
    "tracking/one_target.toml": 30,
}
#: Perfect surveillance and exchanged positions have no sensor; the pilot of one encounter finds
#: nobody in its time.
UNSEEN = {
    "platforms/fleet.toml",
    "platforms/fleet_of_16.toml",
    "platforms/velocities.toml",
    "published/degas.toml",
    "published/degas_unmitigated.toml",
    "published/see_and_avoid.toml",
}
SCENES = sorted(
    name
    for name in (p.relative_to(CONFIGS).as_posix() for p in CONFIGS.rglob("*.toml"))
    if not name.startswith(PARTS) and name not in UNFINISHED
)
WEATHER = ["weather.rain_rate_mm_h=4", "weather.gas=true"]
#: What was looked at, and why the rest was not: there the work that was spared shows.
WORK = {
    "evaluated", "skipped_field_of_view", "skipped_range", "skipped_hidden", "skipped_culled",
}  # fmt: skip


def recorded_both_ways(scene: Scene, folder: Path) -> dict[bool, Path]:
    """Record a scene as it is and with everything simulated; more effects must be built then."""
    built = {}
    for everything in (False, True):
        (folder / str(everything)).mkdir()
        simulation = Simulation(
            scene,
            recorder=Recorder([ParquetSink(folder / str(everything))]),
            simulate_everything=everything,
        )
        simulation.run()
        planned = [*simulation.plan, *simulation.timing_plan]
        built[everything] = sum(item.built for item in planned)
    assert built[True] > built[False]
    return {everything: folder / str(everything) for everything in (False, True)}


def assert_nothing_changed(folders: dict[bool, Path], *, seen: bool = True) -> None:
    """Compare every table byte by byte, and of `scans` all that is not a count of work."""
    names = sorted(path.name for path in folders[False].iterdir())
    assert names == sorted(path.name for path in folders[True].iterdir())
    if seen:
        assert {"detections.parquet", "scans.parquet"} <= set(names)
        assert pq.read_metadata(folders[False] / "detections.parquet").num_rows > 0
    for name in names:
        if name != "scans.parquet":
            same = (folders[False] / name).read_bytes() == (folders[True] / name).read_bytes()
            assert same, name
    if "scans.parquet" not in names:
        return
    spared, whole = (pq.read_table(folders[e] / "scans.parquet") for e in (False, True))
    for column in set(spared.column_names) - WORK:
        assert spared[column].equals(whole[column]), column
    sums = [sum(table[column].to_numpy() for column in WORK) for table in (spared, whole)]
    np.testing.assert_array_equal(*sums)
    assert np.all(whole["evaluated"].to_numpy() >= spared["evaluated"].to_numpy())


def test_every_shipped_scene_is_among_those_compared() -> None:
    assert len(SCENES) >= 24
    for name in UNFINISHED:
        with pytest.raises(SceneError):
            load_scene(CONFIGS / name)


@pytest.mark.parametrize("name", sorted(set(SCENES) - set(LARGE)))
def test_simulating_everything_gives_the_same_bytes(name: str, tmp_path: Path) -> None:
    sets = [f"duration_s={ENDS_S[name]}"] if name in ENDS_S else []
    folders = recorded_both_ways(load_scene(CONFIGS / name, sets=sets), tmp_path)
    assert_nothing_changed(folders, seen=name not in UNSEEN)


@pytest.mark.parametrize("name", LARGE)
def test_simulating_everything_for_many_aircraft_gives_the_same_bytes(
    name: str, tmp_path: Path
) -> None:
    scene = load_scene(CONFIGS / name, duration_s="45")
    assert_nothing_changed(recorded_both_ways(scene, tmp_path))


@pytest.mark.parametrize(
    "sets",
    [
        WEATHER,
        ["blocks.radar.jitter_s=0.02", "blocks.eo.rate_error_ppm=40"],
        ["blocks.radar.latency_s=0.3", "blocks.radar.beam_sweep=true"],
        [
            "blocks.radar.false_alarms=true",
            "blocks.radar.false_alarm_probability=1e-6",
            "navigation.attitude_bias_deg=[1, 2, 3]",
        ],
    ],
    ids=["rain and gas", "clocks", "latency and sweep", "false alarms and navigation"],
)
@pytest.mark.parametrize("name", ["first_light.toml", "replay_daa.toml"])
def test_simulating_everything_beside_what_a_scene_calls_for_gives_the_same_bytes(
    name: str, sets: list[str], tmp_path: Path
) -> None:
    assert_nothing_changed(recorded_both_ways(load_scene(CONFIGS / name, sets=sets), tmp_path))


def with_late_wires(tmp_path: Path) -> Scene:
    """One sensor's wire loses and delays messages, the others do not."""
    file = tmp_path / "late.toml"
    file.write_text(
        f'extends = "{(CONFIGS / "first_light.toml").as_posix()}"\n'
        "wires = [\n"
        '  "traffic -> transform -> gate",\n'
        '  "gate -> radar", "gate -> eo", "gate -> ir", "eo -> fusion", "ir -> fusion",\n'
        '  {from = "radar", to = "fusion", jitter_s = 0.7, drop_probability = 0.3},\n'
        '  "fusion -> tracker",\n'
        "]\n"
    )
    return load_scene(file)


def test_wires_without_loss_are_the_same_when_loss_is_drawn_for_them(tmp_path: Path) -> None:
    scene = with_late_wires(tmp_path)
    assert_nothing_changed(recorded_both_ways(scene, tmp_path))
    for everything, others in ((False, False), (True, True)):
        planned = Simulation(scene, simulate_everything=everything).timing_plan
        loss = {item.block: item.built for item in planned if item.effect.name == "loss"}
        assert loss == {
            "radar.detections -> fusion.detections": True,
            "every other wire": others,
        }


def test_drawing_loss_and_jitter_is_what_everything_means(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = set()
    lateness = WireFaults.lateness_ticks

    def seen(faults: WireFaults, ticks: np.ndarray) -> np.ndarray:
        late = lateness(faults, ticks)
        drawn.add((bool(np.any(faults.jitter_ticks > 0)), bool(np.any(late))))
        return late

    monkeypatch.setattr(WireFaults, "lateness_ticks", seen)
    scene = with_late_wires(tmp_path)
    Simulation(scene).run()
    assert drawn == {(True, True)}
    Simulation(scene, simulate_everything=True).run()
    assert drawn == {(True, True), (False, False)}


def radar(weather: Weather, tolerance: dict[str, float], **changes: object) -> SwerlingRadar:
    parameters = {
        "scan_rate_hz": 1,
        "range_km": 15,
        "power_w": 2.5,
        "antenna_gain_db": 29.5,
        "wavelength_m": 8.57e-3,
        "integration_gain_db": 0,
        "noise_figure_db": 6,
        "bandwidth_hz": 486,
        "swerling": 1,
        **changes,
    }
    context = Context(Streams(1), sections={"weather": weather})
    block = SwerlingRadar("radar", SwerlingParameters(**parameters), context)
    found = plan_effects(block, tolerance)
    context.effects = {item.effect.name: item.effect.build(block) for item in found if item.built}
    block.setup()
    return block


class PathCells:
    """Just enough of `components.sensor.Cells` for the losses on the way."""

    def __init__(self, range_m: np.ndarray, own_alt_m: np.ndarray, alt_m: np.ndarray) -> None:
        self.range_m, self.alt_m, self._own = range_m, alt_m, own_alt_m

    def __len__(self) -> int:
        return len(self.range_m)

    def field_at_rows(self, name: str) -> np.ndarray:
        assert name == "own_alt_m"
        return self._own


def test_what_a_tolerance_leaves_out_stays_inside_it_over_80_scenes() -> None:
    rng = np.random.default_rng(20)
    dropped = tables = 0
    for _ in range(80):
        weather = Weather(
            gas=bool(rng.random() < 0.3),
            rain_rate_mm_h=float(10.0 ** rng.uniform(-5, 1)) if rng.random() < 0.7 else 0.0,
            fog_water_g_m3=float(10.0 ** rng.uniform(-5, -1)) if rng.random() < 0.5 else 0.0,
            rain_top_m=float(rng.uniform(500, 5000)),
        )
        allowed = float(10.0 ** rng.uniform(-4, -0.5))
        changes = {
            "range_km": float(rng.uniform(1, 20)),
            "swerling": int(rng.integers(0, 5)),
            "pulses": int(rng.choice([1, 1, 5, 40])),
            "integration_gain_db": 0,
            "false_alarm_probability": float(10.0 ** rng.uniform(-8, -1)),
            "polarisation": str(rng.choice(["horizontal", "vertical", "circular"])),
        }
        exact = radar(weather, {}, **changes)
        rough = radar(weather, {"detection_probability": allowed}, **changes)
        dropped += len(exact.context.effects) - len(rough.context.effects)
        range_m = rng.uniform(10, changes["range_km"] * 1000, 300)
        own = rng.uniform(0, 5000, 300)
        high = np.maximum(own + range_m * rng.uniform(-1, 1, 300), 0.0)
        cells = PathCells(range_m, own, high)
        rcs = np.full(300, 10.0 ** rng.uniform(-2, 2))
        pd = [
            block._pd_of_model(
                block.echo_snr(cells, rcs), changes["swerling"], None,
                changes["pulses"], changes["false_alarm_probability"],
            )
            for block in (exact, rough)
        ]  # fmt: skip
        tables += rough._method == "table"
        assert np.max(np.abs(pd[0] - pd[1])) <= allowed
    assert dropped > 12, "the tolerances must have left something out"
    assert tables > 20, "and replaced the exact Pd by the table"
