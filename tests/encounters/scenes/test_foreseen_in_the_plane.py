"""What is known of encounters before they are flown is what flying them finds, to the bit."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from wired import sensor

import dsa_des
from components.encounters import risk_metric
from components.encounters.risk_metric import may_climb
from components.well_clear.missed_cylinder import Missed, probability_of_induced_entry
from dsa_des.block.registry import find_component
from dsa_des.studies.foreseen_runs import predict_results
from dsa_des.studies.study_file import read_study
from tests.encounters.scenes.test_closed_loop_risk import SCENE
from tests.encounters.test_pairing import TURNS
from tests.encounters.test_set_file import call

STUDY = """\
scene = "scene.toml"
replicas = 200
allocate = "auto"
[[metrics]]
metric = "risk_ratio"
horizontal_m = {size}
vertical_m = 137.16
by = ["geometry", "bearing"]
needless = true
[draws]
blocks.traffic.encounter = {{ sequence = [0, 1] }}
"""


def foreseen(folder: Path) -> dict[str, Any]:
    study = read_study(folder / "study.toml")
    scene = study.scene(0)
    replicas = [study.replica(number) for number in range(study.replicas)]
    return predict_results(scene, [spec.build(scene) for spec in study.metrics], replicas)


@pytest.mark.parametrize("kind", ["model", "set"])
def test_the_plane_and_the_flights_give_the_same(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = SCENE
    if kind == "model":
        (tmp_path / "model.txt").write_text(TURNS, encoding="utf-8")
        block = 'type = "traffic.encounter_model", file = "model.txt", lat_deg = 52, lon_deg = 4'
        scene = SCENE.replace('type = "traffic.encounters", file = "set.parquet"', block)
        scene = scene.replace("duration_s = 60", "duration_s = 180")
    else:
        recipe = (
            "closest_s = 40\nduration_s = 60\nhorizontal_m = { uniform = [-900, 900] }\n"
            "vertical_m = { uniform = [-160, 160] }\nbearing_deg = { uniform = [-170, 170] }\n"
            "own_speed_mps = 50\nintruder_speed_mps = 60\nown_heading_deg = 217\n"
            "at = [-41.3, 174.8]\ncount = 200\n"
        )
        (tmp_path / "made.toml").write_text(recipe, encoding="utf-8")
        made = ("--made", tmp_path / "made.toml", "--out", tmp_path / "set.parquet")
        assert call("generate", *made).exit_code == 0
    (tmp_path / "scene.toml").write_text(scene, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY.format(size=670.56), encoding="utf-8")
    asked: list[int] = []
    exact = risk_metric.RiskRatios._nominal_flags_and_classes

    def counted(self: Any, group: Any) -> Any:
        asked.append(len(group))
        return exact(self, group)

    monkeypatch.setattr(risk_metric.RiskRatios, "_nominal_flags_and_classes", counted)
    in_plane = foreseen(tmp_path)
    assert sum(asked) < 60, "few are asked of the flights"
    monkeypatch.setattr(risk_metric, "meetings_in_plane", lambda *_: None)
    flown = foreseen(tmp_path)
    assert asked[-1] == 200
    for name, values in flown.items():
        if not name.startswith("geometry."):
            assert in_plane[name].tolist() == values.tolist(), name
    for name, most in (("closest_s", 0.51), ("vertical_miss_m", 5.0)):
        apart = np.abs(in_plane[f"geometry.{name}"] - flown[f"geometry.{name}"])
        assert np.quantile(apart, 0.9) < most
    kept = in_plane["well_clear_lost_nominal"] == 0.0
    expected = "geometry.expected.well_clear_lost_mitigated"
    apart = np.abs(in_plane[expected] - flown[expected])[kept]
    assert np.quantile(apart, 0.9) < 0.0004 and in_plane[expected][kept].max() > 0.001


def test_a_set_of_many_gives_each_encounter_as_alone(tmp_path: Path) -> None:
    """Encounters of a model are made in one set; a run's report does not depend on the others."""
    from components.encounters.encounter_traffic import ModelTraffic, encounter_flights

    (tmp_path / "model.txt").write_text(TURNS, encoding="utf-8")
    block = {"type": "traffic.encounter_model", "file": str(tmp_path / "model.txt")}
    scene = {"duration_s": 1, "wires": ["traffic -> transform -> gate -> radar"],
             "blocks": {"traffic": block, "transform": {"type": "geometry.ellipsoid"},
                        "gate": {"type": "gate"},
                        "radar": sensor("radar.range_boundary", scan_rate_hz=1)}}  # fmt: skip
    parameters = [
        dsa_des.load_scene(scene, sets=[f"blocks.traffic.encounter={n}"])
        .blocks["traffic"]
        .parameters
        for n in (3, 11, 5)
    ]
    together = ModelTraffic.choose_encounters(parameters)
    assert [int(of.numbers[index]) for of, index in together] == [3, 11, 5]
    assert len({id(of) for of, _ in together}) == 1
    for p, (of, index) in zip(parameters, together, strict=True):
        ((alone, at),) = ModelTraffic.choose_encounters([p])
        assert alone.weights[at] == of.weights[index]
        pair = encounter_flights(of, index, "euler"), encounter_flights(alone, at, "euler")
        for one, other in zip(*pair, strict=True):
            assert one.coefficients.tobytes() == other.coefficients.tobytes()


def test_turns_lead_to_the_side_at_the_same_altitude_and_climbs_up_or_down() -> None:
    """Of 152.4 m and 30.48 m: met inside, beside it, at another time, above and never."""
    e, never = np.exp(-1.0), np.inf
    missed = Missed(
        level=np.array([100.0, 502.4, 152.4, 100.0, np.nan]),
        up=np.array([10.0, 100.0, 60.96, 130.48, np.nan]),
        beside=np.array([100.0, 502.4, 5000.0, never, never]),
        above=np.array([10.0, never, 60.0, 130.48, never]),
    )
    turned = probability_of_induced_entry((152.4, 30.48), missed, climbs=False)
    assert turned == pytest.approx([1.0, e, e, 0.0, 0.0], abs=1e-12)
    climbed = probability_of_induced_entry((152.4, 30.48), missed, climbs=True)
    assert climbed[[0, 1, 3, 4]] == pytest.approx([1.0, e, e, 0.0])


@pytest.mark.parametrize(
    ("name", "keys", "climbs"),
    [
        ("operator.stochastic", {"conf": "C", "turn_share": 1}, False),
        ("operator.stochastic", {"conf": "C", "turn_share": 0.9}, True),
        ("avoidance.daidalus", {"conf": "C"}, False),
        ("avoidance.daidalus", {"conf": "C", "manoeuvre": "vertical_speed"}, True),
        ("avoidance.turn_away", {"range_km": 2}, False),
        ("operator.human", {}, True),
    ],
)
def test_what_steers_says_whether_it_may_climb(
    name: str, keys: dict[str, Any], climbs: bool
) -> None:
    cls = find_component(name)
    conf = Path(__file__).parents[3] / "configs/alerting/do365b.conf"
    parameters = cls.Parameters(**{k: conf if v == "C" else v for k, v in keys.items()})
    block: Any = SimpleNamespace(cls=cls, parameters=parameters)
    assert may_climb(block) is climbs
