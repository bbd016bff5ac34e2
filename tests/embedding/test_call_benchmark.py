"""``dsa-des benchmark --embed``: what it counts, not how fast this machine is."""

from click.testing import CliRunner

from components.benchmark.call_times import measure_calls
from dsa_des.cli import main


def test_every_call_is_timed():
    row = measure_calls(calls=12, repeats=2)
    assert row["calls"] == 24
    assert row["sightings"] > 0 and row["sightings"] % 2 == 0  # the same in each repetition
    assert row["undisturbed_us"]["p99"] <= row["wall_us"]["p99"]
    for key in ("wall_us", "cpu_us", "undisturbed_us"):
        times = row[key]
        assert 0.0 < times["p50"] <= times["p99"] <= times["max"]
    assert 0.0 <= row["share_within_wanted"] <= 1.0
    assert row["first_us"] <= row["wall_us"]["max"]


def test_it_measures_one_thing_of_its_own():
    for more in (["thesis"], ["--compare", "old.json"]):
        done = CliRunner().invoke(main, ["benchmark", "--embed", *more])
        assert done.exit_code == 2
        assert "leave out scenes and --compare" in done.output
