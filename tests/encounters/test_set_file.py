"""Sets of encounters: what is written is read, and what is damaged is named or left out."""

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

from components.encounters.command import encounters
from components.encounters.encounter_traffic import encounter_flights
from components.encounters.model_file import read_model
from components.encounters.pair_densities import PairingRules
from components.encounters.pairing import PairSampler
from components.formats.encounter_set import NoSuchEncounter, geometry_class
from components.formats.set_file import EncounterSetError, read_set
from tests.encounters.scenes.test_encounter_traffic_keys import events
from tests.encounters.test_pairing import TURNS

FOOT = 0.3048


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "model.txt"
    path.write_text(TURNS, encoding="utf-8")
    return path


def call(*words: object) -> Result:
    return CliRunner().invoke(encounters, [str(w) for w in words], catch_exceptions=False)


def columns() -> dict[str, list]:
    tracks = [[0.0, 1.0, 2.0], [5.0, 5.0, 5.0]]
    return {
        "encounter": [3, 3, 7, 7, 7],
        "weight": [1.5, 1.5, 0.0, 0.0, 0.0],
        "aircraft": ["own", "a", "own", "b", "c"],
        "time_s": [[0.0, 1.0, 2.5]] * 5,
        "north_m": [tracks[0]] * 5,
        "east_m": [tracks[1]] * 5,
        "altitude_m": [[100.0, 110.0, 120.0]] * 5,
    }


def written(folder: Path, **changes) -> Path:
    path = folder / "set.parquet"
    pq.write_table(pa.table({**columns(), **changes}), path)
    return path


def test_generated_sets_fly_as_the_pairs_did(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "set.parquet"
    done = call("generate", "--model", model, "--count", 12, "--first", 30, "--seed", 4,
                "--at", -41.0, 20.0, "--out", out)  # fmt: skip
    assert done.exit_code == 0 and "12 encounters of 180 s" in done.stdout
    found = read_set(out)
    read = read_model(model)
    pairs = PairSampler(read, read, 4, PairingRules()).sample_pairs(range(30, 42))
    assert found.numbers.tolist() == list(range(30, 42))
    assert found.weights == pytest.approx(pairs.weight, rel=1e-15)
    assert found.reference_deg == (-41.0, 20.0)
    for k in range(12):
        for aircraft in (0, 1):
            time_s, north, east, altitude = found.path(2 * k + aircraft)
            assert time_s.tolist() == list(range(181))
            assert north / FOOT == pytest.approx(pairs.north_ft[aircraft, :, k], abs=1e-6)
            assert east / FOOT == pytest.approx(pairs.east_ft[aircraft, :, k], abs=1e-6)
            assert altitude / FOOT == pytest.approx(pairs.up_ft[aircraft, :, k], abs=1e-6)
    assert found.extra["horizontal_miss_m"] == pytest.approx(pairs.horizontal_ft * FOOT)
    own, other = encounter_flights(found, 0, "euler")
    at = own.at(150.0)
    assert (float(at.lat_deg), float(at.lon_deg)) == pytest.approx((-41.0, 20.0), abs=1e-9)
    assert other.name == "intruder"


def test_what_a_set_says_of_each_encounter_its_paths_show(model: Path, tmp_path: Path) -> None:
    """Bearing and misses by the paths alone, and the numbers that are printed by the weights."""
    out = tmp_path / "set.parquet"
    done = call("generate", "--model", model, "--count", 25, "--seed", 8, "--out", out)
    found = read_set(out)
    squares = (found.weights**2).sum()
    first, second = done.stdout.splitlines()[-2:]
    assert first == f"{out}: 25 encounters of 180 s"
    assert second.startswith(f"effective sample size {found.weights.sum() ** 2 / squares:.1f}; ")
    for k in range(25):
        (_, *own), (_, *other) = found.path(2 * k), found.path(2 * k + 1)
        extra = {name: values[k] for name, values in found.extra.items()}
        closest = int(extra["closest_s"])
        away = np.array(other) - np.array(own)
        miss_m = np.hypot(away[0, closest], away[1, closest])
        assert abs(extra["horizontal_miss_m"]) == pytest.approx(miss_m, abs=0.01)
        assert extra["vertical_miss_m"] == pytest.approx(away[2, closest], abs=0.01)
        heading = found.state["heading_rad"][2 * k]
        bearing = np.degrees(np.arctan2(away[1, 0], away[0, 0]) - heading)
        assert (extra["bearing_deg"] - bearing + 180.0) % 360.0 == pytest.approx(180.0, abs=1e-6)


def test_tracks_are_read_as_they_stand(tmp_path: Path) -> None:
    found = read_set(written(tmp_path))
    assert (found.kind, len(found), found.weights.tolist()) == ("tracks", 2, [1.5, 0.0])
    assert [flight.name for flight in encounter_flights(found, 1, "euler")] == ["own", "b", "c"]
    assert found.path(0)[0].tolist() == [0.0, 1.0, 2.5]
    with pytest.raises(NoSuchEncounter, match="there is no encounter 4; it holds 2, numbered from"):
        found.index_of(4)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"speed_mps": [50.0, 0.0, 50.0, 70.0]}, "4: one: speed_mps must be above 0"),
        ({"speed_mps": [50.0, -1.0, 50.0, 70.0]}, "4: one: speed_mps must be above 0"),
        (
            {"heading_rad": [1.0, 1.0, 1.0, math.nan]},
            "9: other: heading_rad must be a number within ±10000",
        ),
        ({"duration_s": [20.0, math.nan, 20.0, 20.0]}, "4: one: duration_s is missing"),
        ({"duration_s": [20.0, 20.0, 20.0, 86_401.0]}, "other: duration_s must lie in (0, 86400]"),
        ({"duration_s": [20.0, 20.0, 20.0, 0.0]}, "other: duration_s must lie in (0, 86400]"),
        ({"time_s": [[0.0], [0.5, 3.0], [0.0], [0.0]]}, "one: the first event must be at time_s 0"),
    ],
)
def test_a_flight_by_events_that_cannot_be_flown_is_named(
    tmp_path: Path, changes: dict, said: str
) -> None:
    with pytest.raises(EncounterSetError) as error:
        read_set(Path(events(tmp_path / "set.parquet", **changes)))
    assert said in str(error.value)
    # What lies at a limit can be flown.
    limits = {"speed_mps": [50.0, 1e-3, 0.5, 2000.0], "duration_s": [0.05, 86_400.0, 20.0, 20.0],
              "heading_rad": [1e4, -1e4, 1.0, 0.0]}  # fmt: skip
    assert len(read_set(Path(events(tmp_path / "set.parquet", **limits)))) == 2


def test_weights_are_worth_their_effective_sample_size(tmp_path: Path) -> None:
    """Of 3 and 1: 4 squared, over 10."""
    done = call("show", written(tmp_path, weight=[3.0, 3.0, 1.0, 1.0, 1.0]))
    assert "sum of weights 4, effective sample size 1.6" in done.stdout


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"weight": [None, None, 1.0, 1.0, 1.0]}, "encounter 3: weight is missing"),
        ({"weight": [1.0, 1.0, -1.0, -1.0, -1.0]}, "encounter 7: weight must be a number from 0"),
        ({"weight": [1.0, 1.0, 1e200, 1e200, 1e200]}, "weight must be a number from 0 to 1e+90"),
        ({"east_m": [[1.0] * 3] * 4 + [[1.0]]}, "encounter 7: east_m has 1 values, time_s has 3"),
        ({"weight": [1.0, 2.0, 1.0, 1.0, 1.0]}, "encounter 3: its aircraft have different weights"),
        ({"time_s": [[0.0, 1.0, 2.0]] * 4 + [[-1.0, 0.0, 1.0]]}, "7: c: time_s is negative"),
        ({"time_s": [[0.0, 1.0, 1.0]] + [[0.0, 1.0, 2.0]] * 4}, "3: own: times must rise"),
        ({"encounter": [3, 4, 7, 7, 7]}, "encounter 3: has one aircraft: an ownship and an"),
        ({"aircraft": ["own", None, "own", "b", "c"]}, "encounter 3: has no name"),
        ({"altitude_m": [[1.0, float("nan"), 1.0]] + [[1.0] * 3] * 4}, "own: altitude_m holds no"),
        ({"north_m": [[1.0] * 3] * 4 + [[1.0, 6e6, 1.0]]}, "c: north_m must be a number within"),
    ],
)
def test_a_damaged_encounter_is_named_or_skipped_and_counted(
    tmp_path: Path, changes: dict, said: str
) -> None:
    path = written(tmp_path, **changes)
    with pytest.raises(EncounterSetError) as error:
        read_set(path)
    assert said in str(error.value) and str(error.value).startswith(f"{path}: encounter ")
    left = read_set(path, skip_damaged=True)
    assert left.skipped >= 1 and len(left) >= 1
    for place in range(len(left)):
        assert encounter_flights(left, place, "euler")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"altitude": [1.0] * 5}, "unknown variable 'altitude'; did you mean 'altitude_m'?"),
        ({"encounter": [7, 7, 3, 3, 3]}, "rows must be in order of their encounters' numbers"),
        ({"encounter": [3, 3, 7, 7, None]}, "must be whole numbers from 0 to 2^53, none missing"),
        ({"weight": ["x"] * 5}, "column 'weight': holds string; numbers are needed"),
        ({"north_m": [1.0] * 5}, "column 'north_m': holds double; lists are needed"),
        ({"north_m": [["x"] * 3] * 5}, "column 'north_m': holds list<"),
        ({"weight": [0.0] * 5}, "all weights are 0"),
        ({"family": ["x"] * 5}, "column 'family': holds string; numbers are needed"),
    ],
)
def test_a_set_that_is_wrong_as_a_whole(tmp_path: Path, changes: dict, said: str) -> None:
    with pytest.raises(EncounterSetError) as error:
        read_set(written(tmp_path, **changes), skip_damaged=True)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"{", "its metadata are no JSON"),
        (b"\xff", "its metadata are no JSON"),
        (b"null", "its metadata must be a table"),
        (b"[1]", "its metadata must be a table"),
        (b'"text"', "its metadata must be a table"),
        (b'{"reference_deg": [500, 8]}', "reference_deg = [500, 8]: must be [latitude, longitude]"),
        (b'{"reference_deg": [NaN, 8]}', "within \u00b189 and \u00b1360"),
        (b'{"reference_deg": null}', "reference_deg = None"),
        (b'{"reference_deg": [true, 8]}', "reference_deg = [True, 8]"),
    ],
)
def test_damaged_metadata_are_said(tmp_path: Path, content: bytes, said: str) -> None:
    path = written(tmp_path)
    table = pq.read_table(path).replace_schema_metadata({b"dsa_des.encounters": content})
    pq.write_table(table, path)
    with pytest.raises(EncounterSetError) as error:
        read_set(path)
    assert said in str(error.value) and str(error.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("option", "edges", "parts", "said"),
    [
        ("--vertical", "-500,500", "2", "chances must lie above 0 and be 1 at most"),
        ("--vertical", "-500,500", "nan", "chances must lie above 0"),
        ("--vertical", "-500,500", "0", "proportions must be numbers above 0"),
        ("--horizontal", "-500,500", "-1", "proportions must be numbers above 0"),
        ("--horizontal", "-1e300,1e300", "1", "edges must lie within \u00b11e+06 ft"),
        ("--horizontal", "-500,inf", "1", "edges must lie within"),
        ("--horizontal", "100,500", "1", "the edges must lie about 0"),
    ],
)
def test_proportions_that_are_none(
    model: Path, tmp_path: Path, option: str, edges: str, parts: str, said: str
) -> None:
    out = tmp_path / "s.parquet"
    done = call("generate", "--model", model, "--count", 1, option, edges, parts, "--out", out)
    assert (
        done.exit_code == 2 and said in done.stderr and f"{option} {edges} {parts}" in done.stderr
    )
    assert not out.exists()


def test_files_that_are_no_sets(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(EncounterSetError, match="is no whole Parquet file: it may be cut short"):
        read_set(path)
    with pytest.raises(EncounterSetError, match="there is no such file"):
        read_set(tmp_path / "none.parquet")
    missing = {name: values for name, values in columns().items() if name != "weight"}
    pq.write_table(pa.table(missing), path)
    with pytest.raises(EncounterSetError, match="the column 'weight' is missing"):
        read_set(path)
    with pytest.raises(EncounterSetError, match="encounter 3: weight is missing"):
        read_set(written(tmp_path, weight=[None] * 5), skip_damaged=True)


def test_classes_of_geometry() -> None:
    course = np.array([0.0, 65.0, 75.0, 165.0, 180.0, 200.5, 270.0, 300.0])
    assert geometry_class(course).tolist() == [
        "overtaking", "overtaking", "crossing from the left", "head-on", "head-on",
        "crossing from the right", "crossing from the right", "overtaking",
    ]  # fmt: skip


def test_generating_says_what_is_wrong(model: Path, tmp_path: Path) -> None:
    done = call("generate", "--model", model, "--count", 2, "--at", 95, 0, "--out",
                tmp_path / "s.parquet")  # fmt: skip
    assert done.exit_code == 2 and "--at 95.0 0.0: latitude must lie within" in done.stderr
    model.write_text(TURNS[:500], encoding="utf-8")
    done = call("generate", "--model", model, "--count", 2, "--out", tmp_path / "s.parquet")
    assert done.exit_code == 2 and str(model) in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "s.parquet").exists()


def test_miss_distances_are_drawn_as_the_command_line_says(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "s.parquet"
    done = call("generate", "--model", model, "--count", 400, "--out", out, "--horizontal",
                "-3000,0,1000", "1,3", "--vertical", "-300,100,300", "0.25,1")  # fmt: skip
    assert done.exit_code == 0
    found = read_set(out)
    h, v = (found.extra[name] / 0.3048 for name in ("horizontal_miss_m", "vertical_miss_m"))
    assert h.min() >= -3000 and h.max() <= 1000 and v.min() >= -300 and v.max() <= 300
    assert abs((h > 0).mean() - 0.75) < 0.08
    assert abs((v > 100).mean() - 200 / (200 + 0.25 * 400)) < 0.08
    # Undone by the weights: uniform over all that is drawn. 4 standard errors of so uneven ones.
    w = found.weights / found.weights.sum()
    assert abs(w[h > 0].sum() - 0.25) < 0.09 and abs(w[v > 100].sum() - 1 / 3) < 0.11


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--horizontal", "0,low", "1"), "rising edges, ft, and the proportion"),
        (("--horizontal", "-100,0,100", "1"), "3 edges need 2 proportions"),
        (("--vertical", "100,-100", "1"), "edges must be rising"),
        (("--horizontal", "-100,0,0,100", "1,1,1"), "edges must be rising"),
        (("--vertical", "100,200", "1"), "must lie about 0"),
        (("--vertical", "-100,100", "0"), "proportions must be numbers above 0"),
    ],
)
def test_densities_that_are_none(words, said: str, model: Path, tmp_path: Path) -> None:
    out = tmp_path / "s.parquet"
    done = call("generate", "--model", model, "--count", 2, "--out", out, *words)
    assert done.exit_code == 2 and said in done.stderr and not out.exists()


def test_sets_are_written_to_names_of_sets(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "s.bin"
    for words in (("generate", "--model", model, "--count", 2), ("split", out, "--levels", "8",
                  "--copies", "1,2")):  # fmt: skip
        done = call(*words, "--out", out)
        assert (
            done.exit_code == 2 and "s.bin: a name that ends in .parquet is needed" in done.stderr
        )
        assert not out.exists()
