"""``dsa-des encounters generate --tracks``: real flights paired as those of models are."""

import math

import numpy as np
import pytest
import recorded_files as write
from click.testing import CliRunner, Result
from scipy.integrate import quad

from components.formats.encounter_set import EncounterSet
from components.formats.set_file import read_set
from dsa_des.cli import main

FOOT_M = 0.3048
START = 1_717_243_200.0
#: Metres north and east of a degree at the equator, on the ellipsoid.
NORTH_M, EAST_M = 110_574.4, 111_319.5
#: Speeds (m/s) and climbs (m/s) of the three flights.
SPEEDS, CLIMBS = {"slow": 30.0, "fast": 70.0, "climbs": 50.0}, {"climbs": 2.0}


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def flights(folder, seconds=400):
    """Straight flights at the equator in three directions, every five seconds."""
    folder.mkdir()
    for k, (name, speed) in enumerate(SPEEDS.items()):
        course = math.radians(40.0 + 110.0 * k)
        fixes = [
            (START + t, speed * t * math.cos(course) / NORTH_M,
             10 * k + speed * t * math.sin(course) / EAST_M, 1000.0 + CLIMBS.get(name, 0.0) * t)
            for t in range(0, seconds, 5)
        ]  # fmt: skip
        (folder / f"{name}.gpx").write_bytes(write.gpx({name: fixes}))
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> EncounterSet:
    folder = tmp_path_factory.mktemp("tracks")
    out = folder / "set.parquet"
    result = call("encounters", "generate", "--tracks", flights(folder / "f"), "--count", 60,
                  "--seed", 3, "--out", out)  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert "of 3 of 3 flights, 648 windows" in result.stdout.replace("\n", " ")
    return read_set(out)


def test_pairs_are_closest_when_and_where_they_should_be(made):
    horizontal, vertical = [], []
    for index in range(len(made)):
        ((times, own, other),) = made.common_times_and_positions(index)
        assert times.tolist() == list(range(181))
        apart = other - own
        at = int(np.argmin(np.hypot(*apart[:2])))
        # The instant of straight flights: the rules ask for the second after it at the latest.
        assert at in (150, 151)
        speeds = [np.hypot(*np.diff(path[:2])) for path in (own, other)]
        for one in speeds:
            assert np.ptp(one) < 0.5 and min(abs(one[0] - s) for s in SPEEDS.values()) < 0.3
        assert abs(speeds[0][0] - speeds[1][0]) > 10.0  # never one with itself
        # The ownship flies north through the origin; its height is its own.
        assert np.diff(own[1, 149:152]) == pytest.approx(0.0, abs=0.05)
        assert own[:2, 150] == pytest.approx(0.0, abs=1e-6) and 999 < own[2, 0] < 1800
        horizontal.append(np.hypot(*apart[:2, 150]))
        vertical.append(apart[2, 150])
    assert max(horizontal) < 18_240 * FOOT_M and max(map(abs, vertical)) < 1500 * FOOT_M
    assert np.ptp(vertical) > 1000 * FOOT_M and min(horizontal) < 2000 * FOOT_M


def test_weights_undo_what_was_drawn_more_often(made):
    """By integrals of the relative speed, and the densities as the page gives them."""
    steps = [(500, 1 / 500), (1500, 1 / 1250), (18_240, 1 / (1.5 * 16_740))]
    area = 2 * sum(
        height * (edge - before)
        for (edge, height), before in zip(steps, (0, 500, 1500), strict=True)
    )
    for index in range(len(made)):
        ((_, own, other),) = made.common_times_and_positions(index)
        velocities = [(path[:, 151] - path[:, 149]) / 2 / FOOT_M for path in (own, other)]
        first, second = (np.hypot(v[0], v[1]) for v in velocities)
        climb = velocities[1][2] - velocities[0][2]
        speed, _ = quad(
            lambda c, a=first, b=second, h=climb: math.sqrt(a * a + b * b - 2 * a * b * math.cos(c)
                                                          + h * h), 0.0, 2 * math.pi,
        )  # fmt: skip
        apart = (other - own)[:, 150] / FOOT_M
        miss, up = np.hypot(*apart[:2]), abs(apart[2])
        density = next(height for edge, height in steps if miss <= edge + 1e-6) / area
        chance = 1.0 if up < 100 else 1 / 1.5 if up < 500 else 0.5
        if min(abs(up - 100), abs(up - 500)) < 0.5 or min(abs(miss - 500), abs(miss - 1500)) < 0.5:
            continue  # at an edge a rounding decides
        expected = speed / (2 * 60_761) / density / chance
        assert made.weights[index] == pytest.approx(expected, rel=2e-3)


def test_an_encounter_is_the_same_whichever_others_are_made(tmp_path, made):
    folder, out = flights(tmp_path / "f"), tmp_path / "one.parquet"
    result = call("encounters", "generate", "--tracks", folder, "--count", 1, "--first", 17,
                  "--seed", 3, "--out", out)  # fmt: skip
    assert result.exit_code == 0
    one = read_set(out)
    assert one.numbers.tolist() == [17] and one.weights[0] == made.weights[17]
    for mine, other in zip(
        one.common_times_and_positions(0), made.common_times_and_positions(17), strict=True
    ):
        assert all((a == b).all() for a, b in zip(mine, other, strict=True))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--tracks", "f", "--model", "m.txt", "--count", 1), "--tracks are flown by both"),
        (("--tracks", "none", "--count", 1), "must be a folder of recorded flights"),
        (("--tracks", "f"), "--tracks FOLDER and --count N"),
        (("--tracks", "short", "--count", 1), "of which 0 are known for 180 s without a gap"),
    ],
)
def test_what_cannot_be_paired_is_said(tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    flights(tmp_path / "f")
    flights(tmp_path / "short", seconds=150)
    result = call("encounters", "generate", *words, "--out", "set.parquet")
    assert result.exit_code == 2 and said in " ".join(result.stderr.split())
    assert not (tmp_path / "set.parquet").exists()
