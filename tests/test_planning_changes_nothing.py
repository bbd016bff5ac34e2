"""What a scene does not call for can be built or not: nothing that is recorded changes."""

from pathlib import Path

import numpy as np
import pytest

from components.environment.tables import Weather
from components.radar.swerling import SwerlingParameters, SwerlingRadar
from dsa_des.block.component import Context
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.recording import Recorder
from dsa_des.running.effect_plan import plan
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

CONFIGS = Path(__file__).parent.parent / "configs"
SCENES = sorted(p for p in CONFIGS.glob("*.toml") if p.name != "detect_and_sense.toml")
WEATHER = ["weather.rain_rate_mm_h=4", "weather.gas=true"]


@pytest.mark.parametrize("sets", [[], WEATHER], ids=["as it is", "rain and gas"])
@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_simulating_everything_gives_the_same_bytes(
    path: Path, sets: list[str], tmp_path: Path
) -> None:
    scene = load_scene(path, sets=sets)
    built = {}
    for everything in (False, True):
        folder = tmp_path / str(everything)
        folder.mkdir()
        simulation = Simulation(
            scene, recorder=Recorder([ParquetSink(folder)]), simulate_everything=everything
        )
        simulation.run()
        built[everything] = sum(item.built for item in simulation.plan)
    assert built[True] > built[False]
    for table in ("detections", "fused", "tracks"):
        name = f"{table}.parquet"
        assert (tmp_path / "False" / name).read_bytes() == (
            tmp_path / "True" / name
        ).read_bytes(), table


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
    found = plan(block, tolerance)
    context.effects = {item.effect.name: item.effect.build(block) for item in found if item.built}
    block.setup()
    return block


class PathCells:
    """Just enough of `components.sensor.Cells` for the losses on the way."""

    def __init__(self, range_m: np.ndarray, own_alt_m: np.ndarray, alt_m: np.ndarray) -> None:
        self.range_m, self.alt_m, self._own = range_m, alt_m, own_alt_m

    def of_row(self, name: str) -> np.ndarray:
        assert name == "own_alt_m"
        return self._own


def test_what_a_tolerance_leaves_out_stays_inside_it_over_200_scenes() -> None:
    rng = np.random.default_rng(20)
    dropped = tables = 0
    for _ in range(200):
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
            block._pd(block.echo_snr(cells, rcs), changes["swerling"], None)
            for block in (exact, rough)
        ]
        tables += rough._method == "table"
        assert np.max(np.abs(pd[0] - pd[1])) <= allowed
    assert dropped > 30, "the tolerances must have left something out"
    assert tables > 50, "and replaced the exact Pd by the table"
