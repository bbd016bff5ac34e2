"""`dsa-des explain --measure`, and the messages of what effects' parameters may not be."""

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.registry import find_component
from dsa_des.cli import main
from dsa_des.commands.scene import measure_effect_time_shares
from dsa_des.scene.scene import load_scene

SCENE = Path(__file__).parent.parent.parent / "configs" / "first_light.toml"


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def test_measuring_shows_a_share_for_every_effect_that_calculates() -> None:
    sets = [
        "blocks.radar.beam_sweep=true",
        "blocks.radar.mount_azimuth_deg=5",
        "weather.rain_rate_mm_h=5",
    ]
    shares = measure_effect_time_shares(load_scene(SCENE, sets=sets))
    for effect in ("beam sweep", "mounting", "rain"):
        assert 0 < shares["radar", effect] < 1
    # The method of Pd is a choice: there is nothing to time.
    assert ("radar", "exact Pd") not in shares
    result = call("explain", SCENE, "--measure", "--duration", 20)
    assert result.exit_code == 0
    assert "share" in result.stdout and "%" in result.stdout


def test_a_sentence_is_one_line_for_who_reads_a_pipe() -> None:
    title, *lines = call("explain", SCENE).stdout.splitlines()
    assert any("rain: not simulated, [weather] rain_rate_mm_h is 0" in line for line in lines)
    table = lines[: lines.index("")]
    first = {"block", "eo", "ir", "radar", "fusion", "transform", "traffic", "every"}
    assert all(line.split()[0] in first for line in table)
    # No column is so wide that what stands right of it is out of sight, and none is padded.
    assert table[0].split() == ["block", "effect"]
    assert all(line == line.rstrip() for line in table)
    simulated = [": simulated, " in line for line in table if "simulated, " in line]
    assert simulated == sorted(simulated, reverse=True)
    assert title == (
        f"First light: {simulated.count(True)} effects simulated, {simulated.count(False)} not"
    )


def rows_told(*arguments: object) -> set[str]:
    return {" ".join(line.split()) for line in call("explain", *arguments).stdout.splitlines()}


def test_effects_of_time_are_effects_like_others() -> None:
    changes = ["blocks.radar.latency_s=0.25", "blocks.eo.jitter_s=0.01"]
    sets = sets_of([*changes, "blocks.ir.rate_error_ppm=9"])
    assert {
        "radar latency: simulated, latency_s is 0.25",
        "every other block latency: not simulated, latency_s is 0",
        "eo clock jitter: simulated, jitter_s is 0.01",
        "ir clock drift: simulated, rate_error_ppm is 9",
        "every wire loss: not simulated, drop_probability is 0",
        "every wire wire jitter: not simulated, jitter_s is 0",
        "every block shared processor: not simulated, processor is not given",
    } <= rows_told(SCENE, *sets)
    assert {
        "every wire loss: simulated, though drop_probability is 0: everything is simulated",
        "every block shared processor: not simulated, processor is not given",
    } <= rows_told(SCENE, *sets, "--simulate-everything")


def sets_of(sets: list[str]) -> list[str]:
    return [word for change in sets for word in ("--set", change)]


def test_what_everything_leaves_out_is_listed_with_its_reason() -> None:
    said = call("explain", SCENE).stdout
    outside = said[said.index("not covered by its proof") :]
    for name in ("background and sun", "mounting", "navigation", "false alarms", "beam sweep",
                 "shared processor"):  # fmt: skip
        assert f"{name}: " in outside
    assert "rain" not in outside
    seen = call("explain", SCENE, "--set", "blocks.radar.beam_sweep=true").stdout
    assert "beam sweep: it fills" not in seen


def test_every_effect_that_is_not_neutral_says_why() -> None:
    silent = [
        effect.name
        for type_name in entry_points_of()
        for effect in find_component(type_name).effects
        if not effect.neutral and not effect.outside_the_proof
    ]
    assert silent == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("weather.rain_rate_mm_h=-1", "rain_rate_mm_h = -1: must be greater than or equal to 0"),
        ("weather.visibility_km=0", "visibility_km = 0: must be greater than 0"),
        ("blocks.radar.false_alarm_probability=1.5", "= 1.5: must be less than 1"),
        ("blocks.radar.polarisation=horizontl", "did you mean 'horizontal'?"),
        ("blocks.radar.beam_sweep=maybe", "must be true or false"),
        ("terrain.height_m=2000", "must be below the ownship, which is at 1000 m"),
    ],
)
def test_bad_weather_and_parameters_are_named(change: str, words: str) -> None:
    for command in ("check", "explain"):
        result = call(command, SCENE, "--set", change)
        assert result.exit_code == 2
        assert words in " ".join(result.stderr.split())
        assert change.split("=")[0].rsplit(".", 1)[-1] in result.stderr
