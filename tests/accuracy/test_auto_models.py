"""`model = "auto"`: never worse than allowed, cheaper than exact where that is allowed."""

import math
from pathlib import Path
from random import Random
from typing import Any

import pytest
from accuracy_scenes import Listener, run, true_errors, write_scene
from click.testing import CliRunner
from same_runs import same_as_alone

from components.line_of_sight.model_choice import PickedModels
from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

# Of 500 (seeds 0 to 499, run once by hand): none off by more than allowed, 83 % cheaper.
SEEDS = range(40)


def tolerance(seed: int) -> dict[str, float]:
    """Return a budget of a tenth of the radar's 1° to all of it, and with it one of range."""
    draw = Random(-1 - seed)
    allowed = {"angle_deg": 10.0 ** draw.uniform(-1, 0)}
    if draw.random() < 0.5:
        allowed["range_m"] = 10.0 ** draw.uniform(0, 2.5)
    return allowed


def judged(seed: int, folder: Path) -> bool:
    """Run a scene, check that what it allows is kept, and say whether the Earth got cheaper."""
    allowed = tolerance(seed)
    transform = 'model = "auto"' + ('\nattitude = "auto"' if seed % 2 else "")
    simulation, listener = run(write_scene(folder, seed, transform, allowed))
    errors = true_errors(listener)
    rung = simulation.components["transform"].rung
    for angle in ("azimuth", "elevation", "direction"):
        assert errors[angle] <= math.radians(allowed["angle_deg"]), (seed, rung)
    assert errors["range"] <= allowed.get("range_m", math.inf), (seed, rung)
    assert errors["azimuth"] <= rung.bound.azimuth_rad, (seed, rung)
    assert errors["direction"] <= rung.bound.direction_rad + 1e-15, (seed, rung)
    assert errors["range"] <= rung.bound.range_m + 1e-9, (seed, rung)
    return rung.earth != "ellipsoid"


def test_auto_keeps_to_the_budget_and_is_cheaper_in_half_of_the_scenes(tmp_path: Path) -> None:
    cheaper = [judged(seed, tmp_path) for seed in SEEDS]
    assert sum(cheaper) >= len(cheaper) / 2
    assert not all(cheaper), "some scenes must be too hard for a cheap model"


def detections(listener: Listener) -> dict[tuple[str, int, str], dict[str, float]]:
    """Return what was detected, by sensor, scan and target."""
    rows = listener.memory.tables()["detections"].to_pylist()
    return {(row["block"], row["scan"], row["target"]): row for row in rows}


def at_an_edge(sensor: Any, row: dict[str, float], allowed: dict[str, float]) -> bool:
    """Return whether the allowed error moves a target over the limit of a sensor's reach."""
    slack_rad = math.radians(allowed["angle_deg"])
    reach = sensor.reach
    sides = (
        (
            row["true_azimuth_rad"],
            reach.azimuth_rad,
            slack_rad / math.cos(row["true_elevation_rad"]),
        ),
        (row["true_elevation_rad"], reach.elevation_rad, slack_rad),
        (row["true_range_m"], (reach.range_max_m,), allowed["range_m"]),
    )
    return any(abs(value - limit) <= slack for value, limits, slack in sides for limit in limits)


def test_detections_differ_by_no_more_than_allowed_over_80_scenes(tmp_path: Path) -> None:
    """Exact models give way where angle, range and Pd allow it; the Pd budget is a shared one."""
    draw = Random(7)
    cheaper = compared = at_edges = 0
    lost = gained = budget = 0.0
    for seed in range(1000, 1080):
        allowed = {
            "angle_deg": 10.0 ** draw.uniform(-1.5, 0.3),
            "range_m": 10.0 ** draw.uniform(0, 2.5),
            "detection_probability": 10.0 ** draw.uniform(-4, -1),
        }
        exact, reference = run(write_scene(tmp_path, seed, "", {}))
        rough, listener = run(write_scene(tmp_path, seed, "", allowed))
        assert exact.components["transform"].rung == PickedModels("ellipsoid", "exact")
        rung = rough.components["transform"].rung
        cheaper += rung.earth != "ellipsoid"
        truth, found = detections(reference), detections(listener)
        budget += allowed["detection_probability"] * len(truth)
        for key in truth.keys() ^ found.keys():
            row = truth[key] if key in truth else found[key]
            if at_an_edge(exact.components[key[0]], row, allowed):
                at_edges += 1
            else:  # by a change of Pd, which is as likely either way
                lost += key in truth
                gained += key in found
        for key in truth.keys() & found.keys():
            row, other = found[key], truth[key]
            compared += 1
            turn = row["true_azimuth_rad"] - other["true_azimuth_rad"]
            turn = abs(math.remainder(turn, 2 * math.pi))
            lift = abs(row["true_elevation_rad"] - other["true_elevation_rad"])
            assert math.degrees(max(turn, lift)) <= allowed["angle_deg"], (seed, rung)
            shift = abs(row["true_range_m"] - other["true_range_m"])
            assert shift <= allowed["range_m"], (seed, rung)
            if row["detection_probability"] is not None:
                change = abs(row["detection_probability"] - other["detection_probability"])
                assert change <= allowed["detection_probability"], (seed, rung)
    assert cheaper > 16
    assert compared > 400
    assert 0 < at_edges < 0.005 * compared
    assert max(lost, gained) <= budget < 0.02 * compared


def explained(configs: Path, *sets: str) -> list[str]:
    """Return what the transform of the first scene says of its models."""
    simulation = Simulation(load_scene(configs / "first_light.toml", sets=sets))
    return simulation.components["transform"].skipped_work_notes()


AUTO = "blocks.transform.model=auto"
NO_NOISE = [f"blocks.{camera}.noise_equivalent_contrast=0" for camera in ("eo", "ir")]


def test_without_accuracy_nothing_approximate_is_used(configs: Path) -> None:
    assert explained(configs) == []
    assert explained(configs, AUTO) == [
        "geometry: ellipsoid, the reference: [accuracy] allows no error of angle or range"
    ]


def test_explain_names_bound_allowance_and_who_was_refused(configs: Path) -> None:
    # A pitch that is not exactly 0 keeps the exact attitude.
    pitched = "blocks.traffic.ownship.pitch_deg=10"
    picked, refused, attitude = explained(configs, AUTO, "accuracy.angle_deg=0.2", pitched)
    assert picked.startswith("geometry: local radii, its error in angle is at most 0.1")
    assert "[accuracy] allows 0.2 deg" in picked
    assert "[accuracy] range_m is not given and not judged" in picked
    assert refused.startswith("geometry: not flat earth: an error in angle of 0.")
    assert attitude.startswith("geometry: not local radii with small-angle attitude: an error in")


def test_exact_models_give_way_only_if_angle_and_range_are_allowed(configs: Path) -> None:
    one = explained(configs, "accuracy.angle_deg=1")
    assert one == []
    (both,) = explained(configs, "accuracy.angle_deg=1", "accuracy.range_m=100")
    assert both.startswith("geometry: flat earth")


def test_a_named_cheap_model_stays(configs: Path) -> None:
    sets = ["accuracy.angle_deg=0.001", "accuracy.range_m=0.1", "blocks.transform.model=flat_earth"]
    scene = load_scene(configs / "first_light.toml", sets=sets)
    assert Simulation(scene).components["transform"].rung.earth == "flat_earth"


@pytest.mark.parametrize(
    ("sets", "because"),
    [
        (["blocks.eo.dynamic_weight=0.1"], "eo weighs the line of sight's rate"),
        (["blocks.radar.measures_range_rate=true"], "radar measures range rates"),
        (["accuracy.detection_probability=0.1"], "no bound is proven for the Pd of eo"),
        (
            ["accuracy.detection_probability=1e-9", *NO_NOISE],
            "could change a Pd by more than [accuracy]",
        ),
    ],
)
def test_what_keeps_the_exact_model(configs: Path, sets: list[str], because: str) -> None:
    said = explained(configs, AUTO, "accuracy.angle_deg=5", "accuracy.range_m=500", *sets)
    assert said[0].startswith("geometry: ellipsoid")
    assert because in " ".join(said)


def test_simulating_everything_takes_the_reference(configs: Path) -> None:
    scene = load_scene(configs / "first_light.toml", sets=[AUTO, "accuracy.angle_deg=5"])
    transform = Simulation(scene, simulate_everything=True).components["transform"]
    assert (transform.rung.earth, transform.rung.attitude) == ("ellipsoid", "exact")


def test_unknown_model_is_refused_with_the_allowed_ones(configs: Path) -> None:
    with pytest.raises(SceneError, match=r"blocks\.transform.model = 'flat': must be 'auto'"):
        explained(configs, "blocks.transform.model=flat")


def test_auto_pd_says_why_and_contradicts_a_named_method(configs: Path) -> None:
    def said(*sets: str) -> str:
        scene = load_scene(
            configs / "first_light.toml",
            sets=["blocks.radar.model=auto", "blocks.radar.swerling=3", *sets],
        )
        return " ".join(Simulation(scene).components["radar"].skipped_work_notes())

    assert "exact, the reference: [accuracy] allows no error of Pd" in said()
    table = said("accuracy.detection_probability=0.1")
    assert "table, its error is at most 1e-06 and [accuracy] allows 0.1" in table
    assert "not gram_charlier" in table
    assert "a table may err by 1e-06" in said("accuracy.detection_probability=1e-7")
    with pytest.raises(SceneError, match="model is 'auto' and detection is 'table'"):
        said("blocks.radar.detection=table")


def test_auto_camera_stays_and_says_so(configs: Path) -> None:
    scene = load_scene(configs / "first_light.toml", sets=["blocks.eo.model=auto"])
    said = Simulation(scene).components["eo"].skipped_work_notes()
    assert said[-1].startswith("silhouette: convex_hull, as the scene says: for no other")


def test_the_command_explains(configs: Path) -> None:
    arguments = ["explain", str(configs / "first_light.toml"), "--set", AUTO]
    result = CliRunner().invoke(main, [*arguments, "--set", "accuracy.angle_deg=1"])
    assert result.exit_code == 0
    assert "geometry: flat earth" in result.stdout


def test_replicas_in_lock_step_pick_the_same_models_as_separate_runs(tmp_path: Path) -> None:
    """Their radars differ, so each replica has its own, planned with the same tolerance."""
    allowed = {"angle_deg": 1.0, "range_m": 200.0, "detection_probability": 0.02}
    path = write_scene(tmp_path, 11, "", allowed)
    scenes = [
        load_scene(path, seed=seed, sets=[f"blocks.radar.reference_pd={0.8 + 0.01 * seed}"])
        for seed in (1, 2)
    ]
    simulation = same_as_alone(scenes)
    assert simulation.components["transform"].rung.earth == "flat_earth"
