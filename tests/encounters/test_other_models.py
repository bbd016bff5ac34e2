"""Model files of other shapes: correlated, categories that change, odd spacing; exact chances."""

import csv
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import chisquare

from components.encounters.model_file import ModelFileError, read_model
from components.encounters.sampling import EncounterDraws, TrackSampler
from dsa_des.cli import main
from tests.encounters.model_text import (
    BOUNDARIES,
    marginals,
    next_chances,
    slow_reading,
    small_model,
)
from tests.encounters.test_set_file import call

INITIAL = ("A", "\\chi", "hmd", "vmd", "v_1", "v_2", "\\dot h_1", "\\dot h_2", "C_1")
SIZES = (2, 3, 2, 3, 2, 1, 3, 3, 2)
PARENTS = {2: (0, 1), 3: (2,), 6: (4, 8), 7: (5, 6), 8: (0,)}
#: Both aircraft at the closest approach; C_1 is a category that changes.
NOW = ("A", "\\chi", "hmd", "vmd", "v_1", "v_2", "\\dot h_1(t)", "\\dot h_2(t)", "C_1(t)")
#: In another order than at t; that of aircraft 2 depends on those of 1 a second later.
LATER = ("C_1(t+1)", "\\dot h_2(t+1)", "\\dot h_1(t+1)")
LATER_PARENTS = {9: (0, 8), 10: (7, 9, 11), 11: (4, 6)}
EDGES = ("*", "*", "0 0.5 3", "-300 -100 100 300", "60 90 160", "0 100", "-900 -100 100 900",
         "-900 0 100 900", "*")  # fmt: skip


def correlated(seed: int = 3) -> str:
    """Return a model with two aircraft, hmd and vmd, some of its counts broken and some 0."""
    random = np.random.default_rng(seed)

    def table(sizes, parents, which):
        found = []
        for place in which:
            columns = int(np.prod([sizes[p] for p in parents.get(place, ())], dtype=int))
            counts = random.integers(0, 9, (columns, sizes[place])).astype(float) + 0.5
            counts[:, 0] *= random.random(columns) > 0.3
            found += (counts * 5000.0 / counts.sum()).reshape(-1).tolist()
        return " ".join(f"{value:.17g}" for value in found)

    def arrows(count, parents):
        rows = np.zeros((count, count), dtype=int)
        for child, some in parents.items():
            rows[list(some), child] = 1
        return "\n".join(" ".join(map(str, row)) for row in rows)

    def names(some):
        return ", ".join(f'"{name}"' for name in some)

    later = (*SIZES, SIZES[8], SIZES[7], SIZES[6])
    parts = {
        "labels_initial": names(INITIAL), "G_initial": arrows(9, PARENTS),
        "r_initial": " ".join(map(str, SIZES)), "N_initial": table(SIZES, PARENTS, range(9)),
        "labels_transition": names((*NOW, *LATER)), "G_transition": arrows(12, LATER_PARENTS),
        "r_transition": " ".join(map(str, later)),
        "N_transition": table(later, LATER_PARENTS, (9, 10, 11)),
        "boundaries": "\n".join(EDGES), "resample_rates": "0.5 0 0 0 0 1 0.1 0.25 1",
    }  # fmt: skip
    return "".join(f"# {name}\n{content}\n" for name, content in parts.items())


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "cor_v1.txt"
    path.write_text(correlated(), encoding="utf-8")
    return path


def test_states_and_steps_have_the_exact_chances(model: Path) -> None:
    slow = slow_reading(correlated())
    sampler = TrackSampler(read_model(model), EncounterDraws(4, "a"))
    tracks = sampler.sample(range(20_000), 1)
    for place, chance in enumerate(marginals(slow)):
        seen = np.bincount(tracks.initial_bins[place], minlength=SIZES[place])
        assert (seen[chance == 0] == 0).all()
        some = chance > 0
        assert some.sum() == 1 or chisquare(seen[some], chance[some] * 20_000).pvalue > 1e-4
    # From the most frequent state: exact, though variables at t + 1 stand in another order.
    states, counts = np.unique(tracks.initial_bins, axis=1, return_counts=True)
    state = states[:, counts.argmax()]
    here = (tracks.initial_bins == state[:, np.newaxis]).all(axis=0)
    found = tracks.changing[1][:, here]  # ḣ1, ḣ2, C1: the order of the initial variables
    bins = [np.clip(np.searchsorted([float(e) for e in EDGES[p].split()], v, "right") - 1, 0, 2)
            for p, v in zip((6, 7), found[:2], strict=True)]  # fmt: skip
    bins[0][found[0] == 0.0] = 1  # the bin around 0 holds 0 alone; a bin that begins there does not
    chances = next_chances(slow, tuple(int(b) for b in state))
    seen = dict.fromkeys(chances, 0)
    for key in zip((found[2] - 1).astype(int), bins[1], bins[0], strict=True):
        seen[tuple(int(b) for b in key)] += 1
    expected = np.array([chances[key] for key in seen]) * here.sum()
    assert chisquare(list(seen.values()), expected).pvalue > 1e-4


def test_raw_tracks_of_it_name_every_variable_and_count_categories(
    model: Path, tmp_path: Path
) -> None:
    out = tmp_path / "raw.csv"
    done = call("sample", "--model", model, "--count", 40, "--duration-s", 20, "--seed", 2, "--raw",
                "--out", out)  # fmt: skip
    assert done.exit_code == 0
    with out.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["track", "t_s", *INITIAL]
    by_track = {k: [r for r in rows if r["track"] == str(k)] for k in range(40)}
    for some in by_track.values():
        for name, row in zip(INITIAL, EDGES, strict=True):
            values = {r[name] for r in some}
            if row == "*":
                assert values <= {str(k + 1) for k in range(3)}
            if not name.startswith(("\\dot", "C_1")):  # static: rates of theirs do nothing
                assert len(values) == 1, name
    assert len({r["C_1"] for r in rows}) == 2
    # Without --raw there are no flights of such a model, and that is said.
    done = call("sample", "--model", model, "--count", 2, "--duration-s", 2, "--out", out)
    assert done.exit_code == 2 and "it is a correlated model, of two aircraft" in done.stderr


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\n", "\r\n"),
        ("\n", "\n\n"),
        ("# ", "#"),
        ("# labels_initial", "\ufeff# labels_initial"),
        ('"\\dot h_1(t+1)"', '" \\dot  h_1 (t + 1) "'),
        ('"\\dot h_1(t)"', '"\\dot h_1 ( t )"'),
        ('", "', '" ,"'),
        ('"\\dot h_1(t+1)"', '"\\dot h_1(t+1)",'),
    ],
)
def test_other_spacing_is_the_same_model(old: str, new: str, model: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.txt"
    other.write_bytes(correlated().replace(old, new).encode())
    one, two = (
        TrackSampler(read_model(p), EncounterDraws(1, "a")).sample(range(9), 5)
        for p in (model, other)
    )
    assert (one.changing == two.changing).all() and (one.initial == two.initial).all()


def without_hmd(text: str) -> str:
    """Return the model with hmd left out of its transitions, as nothing depends on it there."""
    head, _, tail = text.partition("# labels_transition\n")
    lines = tail.split("\n")
    lines[0] = lines[0].replace('"hmd", ', "")
    rows = [row.split() for row in lines[2:14]]
    del rows[2]
    rows = [" ".join(row[:2] + row[3:]) for row in rows]
    sizes = lines[15].split()
    del sizes[2]
    return "\n".join([head + "# labels_transition", lines[0], lines[1], *rows, lines[14],
                      " ".join(sizes), *lines[16:]])  # fmt: skip


def test_what_does_not_change_may_be_left_out_of_transitions(model: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.txt"
    other.write_text(without_hmd(correlated()), encoding="utf-8")
    one, two = (
        TrackSampler(read_model(p), EncounterDraws(1, "a")).sample(range(9), 20)
        for p in (model, other)
    )
    assert (one.changing == two.changing).all()
    # What changes may not.
    text = correlated().replace('"C_1(t)"', '"C_1"')
    other.write_text(text, encoding="utf-8")
    with pytest.raises(ModelFileError, match="needs 'C_1\\(t\\)' beside it"):
        read_model(other)


def test_climbs_in_feet_per_second_and_turns_in_radians_are_taken_for_what_they_are(
    tmp_path: Path,
) -> None:
    """As the published model of helicopter ambulances has its climbs."""
    usual, other = tmp_path / "usual.txt", tmp_path / "other.txt"
    usual.write_text(small_model(), encoding="utf-8")
    per_second = " ".join(repr(float(edge) / 60) for edge in BOUNDARIES[3].split())
    radians = " ".join(repr(float(np.radians(float(edge)))) for edge in BOUNDARIES[4].split())
    text = small_model().replace(BOUNDARIES[3], per_second).replace(BOUNDARIES[4], radians)
    other.write_text(text, encoding="utf-8")
    tables, said = [], []
    for path in (usual, other):
        out = tmp_path / f"{path.stem}.csv"
        done = call("sample", "--model", path, "--count", 30, "--duration-s", 20, "--out", out)
        assert done.exit_code == 0, done.stderr
        with out.open(encoding="utf-8") as file:
            tables.append([[float(cell) for cell in row] for row in list(csv.reader(file))[1:]])
        said.append(done.stdout)
    assert np.array(tables[1]) == pytest.approx(np.array(tables[0]), rel=1e-9, abs=1e-6)
    assert "note:" not in said[0]
    assert "variable '\\dot h' is read in ft/s: its values reach 20 only" in said[1]
    assert "variable '\\dot \\psi' is read in rad/s" in said[1]
    out = tmp_path / "s.parquet"
    done = call("generate", "--model", usual, "--intruder-model", other, "--count", 2, "--out", out)
    assert f"note: {other}: variable '\\dot h' is read in ft/s" in done.stdout
    traffic = f'type = "traffic.encounter_model"\nfile = "{other}"\nencounter = 1\n'
    scene = tmp_path / "s.toml"
    scene.write_text(f'extends = "detect_and_sense"\n[blocks.traffic]\n{traffic}', encoding="utf-8")
    checked = CliRunner().invoke(main, ["check", str(scene)])
    assert checked.exit_code == 0, checked.output
    assert "variable '\\dot h' is read in ft/s" in checked.stderr


def test_the_model_that_cannot_be_flown_is_named(model: Path, tmp_path: Path) -> None:
    own, out = tmp_path / "own.txt", tmp_path / "s.parquet"
    own.write_text(small_model(), encoding="utf-8")
    for pair in ((own, model), (model, own)):
        done = call("generate", "--model", pair[0], "--intruder-model", pair[1], "--count", 2,
                    "--out", out)  # fmt: skip
        assert done.exit_code == 2
        assert f"error: {model}: it is a correlated model" in done.stderr


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("balloon", "it is a model of balloons"),
        ("terminal", "part '# labels_transition' is missing"),
    ],
)
def test_models_that_are_not_flown_are_called_what_they_are(
    name: str, said: str, tmp_path: Path
) -> None:
    parts = {
        "labels_initial": '"L", "\\dot h"', "G_initial": "0 1\n0 0", "r_initial": "2 2",
        "N_initial": "3 1 2 1 1 0", "labels_transition": '"L", "\\dot h(t)", "\\dot h(t+1)"',
        "G_transition": "0 0 0\n0 0 1\n0 0 0", "r_transition": "2 2 2", "N_transition": "3 1 1 3",
        "boundaries": "0 1200 3000\n-800 0 800", "resample_rates": "0 0.1",
    }  # fmt: skip
    if name == "terminal":
        parts = {key: text for key, text in parts.items() if "transition" not in key}
    path = tmp_path / f"{name}_v1.txt"
    path.write_text("".join(f"# {key}\n{text}\n" for key, text in parts.items()), encoding="utf-8")
    done = call("sample", "--model", path, "--count", 2, "--duration-s", 2, "--out",
                tmp_path / "o.csv")  # fmt: skip
    assert done.exit_code == 2 and f"{path}: " in done.stderr and said in done.stderr
    checked = CliRunner().invoke(main, ["check", str(path)])
    assert checked.exit_code == 2 and "is an encounter model: dsa-des enc" in checked.stderr
