"""Public formats read and written, and what is said of a set."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from components.encounters.encounter_tables import EncounterTable, _class_labels_and_errors
from components.encounters.set_commands import closest_approaches
from components.formats.set_file import read_set
from components.formats.track_files import _refuse_cut_off, read_paired_text
from tests.encounters.reference_data import reference_file
from tests.encounters.test_set_file import call

FOOT = 0.3048
PAIRED = """\
NAME,  east, north, alt, trk, gs, vs, time
unitless, [ft], [ft], [ft], [rad], [ftps], [ftps], [s]
OWNSHIP, 0, -100, 1000, 0, 100, 0, 0
OWNSHIP, 0, 0, 1000, 0, 100, 0, 1
OWNSHIP, 0, 100, 1000, 0, 100, 0, 2
INTRUDER, 80, 90, 1020, 0, 50, 10, 0
INTRUDER, 30, 0, 1030, 0, 50, 10, 1
INTRUDER, -20, -90, 1040, 0, 50, 10, 2
"""


def paired(folder: Path, text: str = PAIRED, name: str = "1.txt") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_paired_tracks_become_a_set(tmp_path: Path) -> None:
    out, table = tmp_path / "set.parquet", tmp_path / "weights.csv"
    table.write_text("encounter,weight\n1,4\n0,2.5\n", encoding="utf-8")
    files = paired(tmp_path), paired(tmp_path, PAIRED.replace("1020", "1025"), "2.txt")
    done = call("convert", *files, "--weights", table, "--at", 40, 5, "--out", out)
    assert done.exit_code == 0 and "2 encounters" in done.stdout
    found = read_set(out)
    assert found.weights.tolist() == [2.5, 4.0] and found.reference_deg == (40.0, 5.0)
    moved = tmp_path / "moved.parquet"
    assert call("convert", out, "--at", -41, 174, "--out", moved).exit_code == 0
    assert read_set(moved).reference_deg == (-41.0, 174.0)
    assert read_set(moved).weights.tolist() == [2.5, 4.0]
    time_s, north, east, up = found.path(1)
    assert time_s.tolist() == [0, 1, 2]
    assert north == pytest.approx(np.array([90, 0, -90]) * FOOT)
    assert east == pytest.approx(np.array([80, 30, -20]) * FOOT)
    assert up == pytest.approx(np.array([1020, 1030, 1040]) * FOOT)
    table.write_text("encounter,weight\n0,2.5\n", encoding="utf-8")
    done = call("convert", *files, "--weights", table, "--out", out)
    assert done.exit_code == 2 and "encounter 1: weight is missing" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("alt,", "height,", "line 1: there is no column 'alt'"),
        ("[s]", "[min]", "line 2: time is in 'min': must be s"),
        ("1000, 0, 100, 0, 2", "1000, 0, 100, 0, -2", "line 5: time = -2 is negative"),
        ("1000, 0, 100, 0, 2", "1000, 0, 100, 0", "line 5: has 7 values, but there are 8"),
        ("1000, 0, 100, 0, 2", "x, 0, 100, 0, 2", "line 5: holds something else than numbers"),
        ("INTRUDER", "OWNSHIP", "has one aircraft: an ownship and an intruder are needed"),
    ],
)
def test_damaged_tracks_are_named_or_skipped(tmp_path, old: str, new: str, said: str) -> None:
    files = paired(tmp_path, PAIRED.replace(old, new)), paired(tmp_path, name="2.txt")
    out = tmp_path / "set.parquet"
    done = call("convert", *files, "--out", out)
    assert done.exit_code == 2 and f"{files[0]}: {said}" in done.stderr
    done = call("convert", *files, "--skip-damaged", "--out", out)
    assert done.exit_code == 0 and "1 damaged encounters were skipped" in done.stdout
    assert read_set(out).numbers.tolist() == [1]


def waypoints(negative: bool = False) -> bytes:
    """Two encounters of two aircraft by hand."""
    content = struct.pack("<II", 2, 2)
    for k in range(2):
        content += struct.pack("<3d", 0, 10 * k, 1000) + struct.pack("<3d", 500, 0, 1100)
        time = -1.0 if negative and k == 1 else 20.0
        content += struct.pack("<H", 1) + struct.pack("<4d", 20, 2000, 10, 1000)
        content += struct.pack("<H", 2) + struct.pack("<4d", 10, 600, 5, 1100)
        content += struct.pack("<4d", time, 700, 9, 1150)
    return content


def test_waypoints_there_and_back(tmp_path: Path) -> None:
    path, out, back = tmp_path / "w.bin", tmp_path / "set.parquet", tmp_path / "b.bin"
    path.write_bytes(waypoints())
    assert call("convert", path, "--out", out).exit_code == 0
    found = read_set(out)
    assert len(found) == 2 and found.names == ("ownship", "intruder") * 2
    assert found.path(3)[0].tolist() == [0, 10, 20]
    assert found.path(3)[1] == pytest.approx(np.array([500, 600, 700]) * FOOT)
    assert found.path(2)[2] == pytest.approx(np.array([10, 10]) * FOOT)
    assert call("convert", out, "--out", back).exit_code == 0
    again = tmp_path / "again.parquet"
    assert call("convert", back, "--out", again).exit_code == 0
    for name, values in read_set(again).lists.items():
        assert values == pytest.approx(found.lists[name], abs=1e-9)


def test_damaged_waypoints(tmp_path: Path) -> None:
    path, out = tmp_path / "w.bin", tmp_path / "set.parquet"
    path.write_bytes(waypoints(negative=True))
    done = call("convert", path, "--out", out)
    assert done.exit_code == 2 and f"{path}: encounter 1: intruder: time is negative" in done.stderr
    done = call("convert", path, "--skip-damaged", "--out", out)
    assert "1 damaged encounters were skipped" in done.stdout and len(read_set(out)) == 1
    path.write_bytes(waypoints()[:-9])
    assert "encounter 1: the file is cut short" in call("convert", path, "--out", out).stderr
    path.write_bytes(waypoints() + b"x")
    assert "1 bytes are left behind the last" in call("convert", path, "--out", out).stderr
    path.write_bytes(struct.pack("<II", 2, 1))
    assert "each encounter has 1 aircraft" in call("convert", path, "--out", out).stderr
    done = call("convert", path, paired(tmp_path), "--out", out)
    assert done.exit_code == 2 and "must be one set" in done.stderr


def test_published_encounters_have_their_published_closest_approaches(tmp_path: Path) -> None:
    summary = reference_file("pairing_encounters/summary.csv").read_text(encoding="utf-8")
    names, *rows = [line.split(",") for line in summary.strip().split("\n")]
    files = [reference_file(f"pairing_encounters/{row[0]}.txt") for row in rows]
    out = tmp_path / "set.parquet"
    assert call("convert", *files, "--out", out).exit_code == 0
    closest = closest_approaches(read_set(out), range(len(rows)))
    for k, row in enumerate(rows):
        told = dict(zip(names, map(float, row), strict=True))
        slant = np.hypot(closest.horizontal_m[k], closest.vertical_m[k]) / FOOT
        assert slant == pytest.approx(told["min_slant_ft"], abs=15.0)
        assert closest.time_s[k] == pytest.approx(told["tca_s"], abs=0.3)
    # vs is in ft/s: altitudes change by it.
    _, _, _, up = read_paired_text(files[4])[0][1]
    assert np.abs(np.diff(up)).max() < 10


def test_what_is_said_of_a_set(tmp_path: Path) -> None:
    out, figure = tmp_path / "set.parquet", tmp_path / "set.png"
    call("convert", paired(tmp_path), paired(tmp_path, name="2.txt"), "--out", out)
    done = call("show", out, "--figure", figure)
    assert done.exit_code == 0, done.stderr
    assert "2 encounters of tracks, 4 flights" in done.stdout
    assert "sum of weights 2, effective sample size 2.0" in done.stdout
    assert figure.read_bytes().startswith(b"\x89PNG")
    # By hand: from (190 north, 80 east, 20 up) with (-190, -50, +10) per second, then alike.
    closest = closest_approaches(read_set(out), [0])
    share = (190 * 190 + 80 * 50 - 20 * 10) / (190**2 + 50**2 + 10**2)
    assert closest.time_s[0] == pytest.approx(share)
    level = np.hypot(190 - 190 * share, 80 - 50 * share) * FOOT
    assert closest.horizontal_m[0] == pytest.approx(level)
    assert closest.vertical_m[0] == pytest.approx((20 + 10 * share) * FOOT)
    assert call("show", tmp_path / "none.parquet").exit_code == 2


@pytest.mark.parametrize("count", [10, 3_000_000])
def test_packed_elements_are_looked_through_to_their_ends(count):
    """A megabyte at a time, of the few kilobytes that so many zeros are packed into."""
    packed = zlib.compress(b"\0" * count, 9)
    head = b" " * 124 + b"\0\1IM"
    element = struct.pack("<II", 15, len(packed)) + packed
    _refuse_cut_off(head + element + element)
    short = head + struct.pack("<II", 15, len(packed) - 6) + packed[:-6]
    with pytest.raises(ValueError, match=rf"packed element that ends at byte {len(short)} is cut"):
        _refuse_cut_off(short)
    with pytest.raises(ValueError, match=f"an element of {len(packed)} bytes is cut off at byte"):
        _refuse_cut_off((head + element)[:-1])


@pytest.mark.parametrize("at", [(89.5, 0.0), (0.0, 361.0)])
def test_a_set_is_put_at_no_impossible_origin(tmp_path, at):
    out = tmp_path / "out.parquet"
    done = call("convert", paired(tmp_path), "--at", *at, "--out", out)
    assert done.exit_code == 2 and not out.exists()
    assert f"--at {at[0]} {at[1]}: latitude must lie within ±89, longitude" in done.stderr


def test_classes_are_named_by_the_edges_on_both_sides():
    values: list[object] = [7, "0.5", 1, 4.99, "2", "many", None, -3]
    table = EncounterTable(Path("t.csv"), {"x": values}, list(range(1, 9)))
    labels, wrong = _class_labels_and_errors(table, "x", "1,2,5")
    below, inner, top = "1: below 1", ("2: 1 to 2", "3: 2 to 5"), "4: 5 and above"
    assert labels[[0, 1, 2, 3, 4, 7]].tolist() == [top, below, *inner, inner[1], below]
    assert wrong == {5: "x is no number", 6: "x is no number"}
    assert _class_labels_and_errors(table, None, None)[0].tolist() == [0] * 8
    one = EncounterTable(Path("t.csv"), {"a": ["p", None], "b": [1, 2]}, [1, 2])
    assert _class_labels_and_errors(one, "a, b", None)[0].tolist() == ["p, 1", ", 2"]
