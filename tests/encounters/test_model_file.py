"""Model files that are wrong: one error that names the file, and the line or the variable."""

from pathlib import Path

import numpy as np
import pytest

from components.encounters.model import NetworkError, make_network
from components.encounters.model_file import ModelFileError, read_model
from tests.encounters.model_text import small_model
from tests.encounters.reference_data import reference_file

TEXT = small_model()


def refused(folder: Path, text: str) -> str:
    path = folder / "model.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelFileError) as error:
        read_model(path)
    said = str(error.value)
    assert said.startswith(str(path)) and "\n" not in said
    return said.removeprefix(f"{path}: ")


def changed(old: str, new: str, count: int = 1) -> str:
    assert old in TEXT
    return TEXT.replace(old, new, count)


def row(part: str, text: str = TEXT) -> str:
    return text.split(f"# {part}\n")[1].split("\n")[0]


def test_a_good_model_is_read_by_name(tmp_path: Path) -> None:
    path = tmp_path / "model.txt"
    path.write_text(TEXT, encoding="utf-8")
    model = read_model(path)
    assert model.labels == ("A", "v", "\\dot v", "\\dot h", "\\dot \\psi", "L")
    assert model.dynamic_indices == (2, 3, 4) and not model.notes
    assert model.bins[0].edges is None
    # The bin around zero holds zero only.
    assert model.bins[3].low.tolist() == [-900.0, 0.0, 450.0]
    assert model.bins[3].width.tolist() == [600.0, 0.0, 750.0]
    order = model.initial.order
    assert order.index(4) < order.index(1) < order.index(3)
    later = model.transition.order
    assert later.index(8) < later.index(6) < later.index(7)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("# G_initial", "# G_initail", "there is no part 'G_initail'; did you mean 'G_initial'?"),
        ("# r_initial", "# N_initial", "'N_initial' stands where 'r_initial' is expected"),
        ('"\\dot h(t)"', '"\\dot hh(t)"', "unknown variable '\\\\dot hh(t)'; did you mean"),
        ('"\\dot h(t)", ', "", "needs '\\dot h(t)' beside it"),
        ("20 60 90 140", "20 60 90", "variable 'v' has 3 bins: 4 edges are needed, or *; there"),
        ("20 60 90 140", "20 90 60 140", "variable 'v': edges must be rising numbers"),
        ("500 1500 4000\n", "", "boundaries: 6 rows are needed, one for each variable; there"),
        ("0.3 0.05", "0.3 1.05", "variable '\\dot v': 1.05 must lie in [0, 1]"),
        ("0.3 0.05", "0.3", "resample_rates: 6 are needed, one for each variable; there are 5"),
        ("0.3 0.05", "0.3 x", "'x': must be probabilities of 0 or more"),
        ("2 3 2 3 3 2 \n", "2 3 2 3 3 \n", "6 numbers of bins are needed"),
        ("2 3 2 3 3 2 \n", "2 3 2 3 3 2.5 \n", "variable 'L' has 2.5 bins: must be a whole"),
        ("2 3 2 3 3 2 2 3 3 ", "2 3 2 3 3 2 2 4 3 ", "has 4 bins, but '\\dot h' has 3"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert said in refused(tmp_path, changed(old, new))


def test_counts_that_are_missing_left_over_or_negative(tmp_path: Path) -> None:
    counts = row("N_initial").split()
    short = TEXT.replace(row("N_initial"), " ".join(counts[:-1]))
    assert "variable 'L': 12 counts are needed (2 bins times 6 combinations" in refused(
        tmp_path, short
    )
    long = TEXT.replace(row("N_initial"), " ".join([*counts, "3"]))
    assert "N_initial: 60 counts stand there, 59 are needed" in refused(tmp_path, long)
    minus = TEXT.replace(row("N_initial"), " ".join(["-4", *counts[1:]]))
    assert "'-4': must be counts of 0 or more" in refused(tmp_path, minus)
    nothing = TEXT.replace(row("N_initial"), " ".join(["0", "0", *counts[2:]]))
    assert "variable 'A': all its counts are 0" in refused(tmp_path, nothing)


def test_one_variable_whose_rows_sum_to_something_else_is_named(tmp_path: Path) -> None:
    counts = row("N_initial").split()
    odd = TEXT.replace(row("N_initial"), " ".join([str(int(counts[0]) + 3), *counts[1:]]))
    said = refused(tmp_path, odd)
    assert "variable 'A': its counts sum to 4003, those of the other variables to 4000" in said


def test_a_file_that_is_cut_short_anywhere_is_refused(tmp_path: Path) -> None:
    for part in (1, 3, 7, 10, 13, 16, 19):
        cut = TEXT[: len(TEXT) * part // 20]
        assert refused(tmp_path, cut)
    lines = TEXT.split("\n")
    for end in range(1, len(lines) - 2):
        assert refused(tmp_path, "\n".join(lines[:end]))


def test_arrows_in_a_circle() -> None:
    arrows = np.array([[0, 1, 0], [0, 0, 1], [0, 1, 0]])
    with pytest.raises(NetworkError, match="form a circle among 'b', 'c'"):
        make_network("abc", (2, 2, 2), arrows, np.ones(2 + 8 + 4), [0, 1, 2])


def test_parents_of_what_is_not_drawn(tmp_path: Path) -> None:
    now = TEXT.split("# G_transition\n")[1].split("\n# r_transition")[0].split("\n")
    wrong = [*now]
    wrong[0] = "0 1" + wrong[0][3:]
    said = refused(tmp_path, TEXT.replace("\n".join(now), "\n".join(wrong)))
    assert "variable 'v' has parents, but is not drawn" in said


def test_files_that_are_none(tmp_path: Path) -> None:
    assert "must begin with the line '# labels_initial'" in refused(tmp_path, "hello\n")
    with pytest.raises(ModelFileError, match="there is no such file"):
        read_model(tmp_path / "none.txt")
    with pytest.raises(ModelFileError, match="is a folder"):
        read_model(tmp_path)


@pytest.mark.parametrize("name", ["paramotor_v1", "uncor_1200code_v1"])
def test_published_models_are_read_without_a_note(name: str) -> None:
    assert read_model(reference_file(f"models/{name}.txt")).notes == ()
