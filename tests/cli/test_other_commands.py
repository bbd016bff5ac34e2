"""`dsa-des check`, `graph` and `components`, and every scene of the project."""

import struct
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dsa_des.block.entry_points import entry_points_of
from dsa_des.cli import main

CONFIGS = Path(__file__).parent.parent.parent / "configs"
SCENES = sorted(p for p in CONFIGS.glob("*.toml") if p.name != "detect_and_sense.toml")


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


@pytest.mark.parametrize("scene", SCENES, ids=lambda p: p.stem)
def test_every_scene_of_ours_checks(scene: Path) -> None:
    result = call("check", scene)
    assert result.exit_code == 0, result.stderr
    assert "ok. 8 blocks, 9 wires" in result.stdout


def test_scene_without_traffic_says_what_is_missing() -> None:
    result = call("check", CONFIGS / "detect_and_sense.toml")
    assert result.exit_code == 2
    assert "the scene has no block 'traffic'" in result.stderr


def test_graph_as_text_lists_blocks_by_depth() -> None:
    output = call("graph", CONFIGS / "first_light.toml").stdout
    order = [output.index(f" {name} ") for name in ("traffic", "transform", "gate", "fusion")]
    assert order == sorted(order)


def test_graph_says_of_a_loop_that_it_runs_in_windows() -> None:
    every = call("graph", CONFIGS / "avoidance" / "crossing.toml").stdout
    assert every.count("look") == 10 and "scan by" not in every  # of 10 blocks


def test_graph_as_dot_is_the_whole_graph() -> None:
    output = call("graph", CONFIGS / "first_light.toml", "--dot").stdout
    assert output.startswith('digraph "First light" {') and output.rstrip().endswith("}")
    assert output.count("->") == 9
    assert '"radar" -> "fusion" [label="Detections"]' in output


def test_graph_as_png_is_a_picture(tmp_path: Path) -> None:
    path = tmp_path / "graph.png"
    assert call("graph", CONFIGS / "first_light.toml", "--png", "--out", path).exit_code == 0
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_graph_s_picture_is_as_high_as_most_blocks_stand_in_one_column(tmp_path: Path) -> None:
    """Six columns of 2.1 inches and three rows, the sensors, of 1.1, with a margin of 1.2."""
    path = tmp_path / "graph.png"
    call("graph", CONFIGS / "first_light.toml", "--png", "--out", path)
    width, height = struct.unpack(">II", path.read_bytes()[16:24])
    assert width / height == pytest.approx((1.2 + 2.1 * 6) / (1.2 + 1.1 * 3), rel=0.01)


def test_graph_refuses_two_forms() -> None:
    result = call("graph", CONFIGS / "first_light.toml", "--png", "--dot")
    assert result.exit_code == 2
    assert "not both" in result.stderr


def test_components_lists_every_registered_type() -> None:
    output = call("components").stdout
    assert all(name in output for name in entry_points_of())
    assert "cannot be loaded" not in output


@pytest.mark.parametrize("name", sorted(entry_points_of()))
def test_components_describes_ports_and_parameters(name: str) -> None:
    output = call("components", name).stdout
    cls = entry_points_of()[name].load()
    for port in [*cls.inputs, *cls.outputs, *cls.Parameters.model_fields]:
        assert port in output
    undocumented = [f for f, i in cls.Parameters.model_fields.items() if not i.description]
    assert not undocumented


def test_components_names_the_nearest_type() -> None:
    result = call("components", "radar.swirling")
    assert result.exit_code == 2
    assert "did you mean 'radar.swerling'" in result.stderr
