"""Tables and matrices of tracks become encounters: places by pymap3d, and what is wrong."""

import math
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from scipy.io import savemat
from scipy.io.matlab import MatlabObject

from components.encounters.encounter_traffic import encounter_flights
from components.formats.set_file import read_set
from tests.encounters.test_set_file import call

FT = 0.3048
HEAD = "ID,Time,lat,lon,alt_AGL_ft,speed_kts,heading_deg,dh_fpm,alt_MSL_ft\n"


def geodetic(path: Path, rows, who: str = "1") -> Path:
    lines = [f"{who},{t},{lat!r},{lon!r},0,100,0,0,{alt}" for t, lat, lon, alt in rows]
    path.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def plane(path: Path, rows) -> Path:
    lines = [",".join(map(str, row)) for row in rows]
    path.write_text("time_s,x_ft,y_ft,z_ft\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


OWN = [(0, -41.3, 179.9997, 3000), (1, -41.3005, 180.0009, 3010), (2, -41.301, 180.002, 3020)]
OTHER = [(0, -41.31, -179.99, 2500), (2, -41.30, -179.999, 2600)]


def test_two_files_of_one_aircraft_are_an_encounter(tmp_path: Path) -> None:
    files = geodetic(tmp_path / "a.csv", OWN), geodetic(tmp_path / "b.csv", OTHER)
    out = tmp_path / "s.parquet"
    assert call("convert", *files, "--out", out).exit_code == 0
    found = read_set(out)
    assert len(found) == 1 and found.names == ("ownship", "intruder")
    assert found.reference_deg == pytest.approx((-41.3, 179.9997))
    for row, rows in ((0, OWN), (1, OTHER)):
        time_s, north, east, up = found.path(row)
        for k, (t, lat, lon, alt) in enumerate(rows):
            e, n, _ = pymap3d.geodetic2enu(lat, lon, 0, -41.3, 179.9997, 0)
            assert (time_s[k], up[k]) == pytest.approx((t, alt * FT))
            assert (north[k], east[k]) == pytest.approx((n, e), abs=1e-6)
    # FlownTracks again, they are where the file says.
    own, other = encounter_flights(found, 0, "euler")
    lat = other.at(np.array([2.0])).lat_deg[0]
    assert lat == pytest.approx(-41.30, abs=2e-7)
    assert own.at(np.array([0.0])).alt_m[0] == pytest.approx(914.4)


def test_tables_of_both_aircraft_and_of_the_plane(tmp_path: Path) -> None:
    text = geodetic(tmp_path / "both.csv", OWN).read_text(encoding="utf-8")
    other = geodetic(tmp_path / "o.csv", OTHER, "2").read_text(encoding="utf-8")
    (tmp_path / "both.csv").write_text(text + other.removeprefix(HEAD), encoding="utf-8")
    x = plane(tmp_path / "x.csv", [(0, 100, 20, 3000), (1, 250, 20, 3000)])
    y = plane(tmp_path / "y.csv", [(0, 4000, -50, 3100), (1, 3800, -50, 3100)])
    out = tmp_path / "s.parquet"
    done = call("convert", tmp_path / "both.csv", x, y, "--at", 10, 20, "--out", out)
    assert done.exit_code == 0
    found = read_set(out)
    assert len(found) == 2 and found.reference_deg == (10.0, 20.0)
    _, north, east, up = found.path(3)
    assert (north[0], east[0], up[0]) == pytest.approx((4000 * FT, -50 * FT, 3100 * FT))
    shown = call("show", x, y)
    assert shown.exit_code == 0 and "1 encounters of tracks" in shown.stdout
    apart = math.hypot(3800 - 250, 70) * FT
    assert f"{apart:.4g}" in shown.stdout


def matrix(start: float, count: int = 5) -> np.ndarray:
    t = np.arange(count)
    return np.array([t, start + 100.0 * t, -start + 0 * t, 3000 + t, 100 + 0 * t, 0 * t, 1 + 0 * t])


def cells(*matrices: np.ndarray) -> np.ndarray:
    found = np.empty(len(matrices), dtype=object)
    for k, one in enumerate(matrices):
        found[k] = one
    return found


@pytest.mark.parametrize(
    "content",
    [
        {"aircraft_10": matrix(900), "aircraft_2": matrix(10), "dt": 0.1},
        {"traj": np.stack([matrix(10), matrix(900)], axis=2)},
        {"results": {"a": matrix(10), "b": matrix(900)}},
        {"cells": cells(matrix(10), matrix(900, 6))},
    ],
)
def test_matrices_of_seven_rows(content, tmp_path: Path) -> None:
    savemat(tmp_path / "traj.mat", content)
    out = tmp_path / "s.parquet"
    assert call("convert", tmp_path / "traj.mat", "--out", out).exit_code == 0
    found = read_set(out)
    for row, start in ((0, 10), (1, 900)):
        _, north, east, up = found.path(row)
        assert (north[1], east[1], up[1]) == pytest.approx(
            ((start + 100) * FT, -start * FT, 3001 * FT)
        )


def test_what_is_wrong_names_file_and_line_and_can_be_skipped(tmp_path: Path) -> None:
    own = geodetic(tmp_path / "own.csv", OWN)
    good = geodetic(tmp_path / "good.csv", OTHER)
    out = tmp_path / "s.parquet"

    def refused(*files: Path) -> str:
        done = call("convert", *files, "--out", out)
        assert done.exit_code == 2 and "Traceback" not in done.stderr and not out.exists()
        return done.stderr

    assert "own.csv: has one aircraft" in refused(own)
    bad = geodetic(tmp_path / "bad.csv", [(0, 1.0, 2.0, 3), (-1, 1.0, 2.0, 3)])
    assert "bad.csv: line 3: time = -1 is negative" in refused(own, bad)
    bad.write_text(HEAD.replace("alt_MSL_ft", "alt_MLS_ft"), encoding="utf-8")
    assert "there is no column 'alt_MSL_ft'; did you mean 'alt_MLS_ft'?" in refused(own, bad)
    bad.write_text(HEAD + "1,0,x,0,0,0,0,0,0\n", encoding="utf-8")
    assert "bad.csv: line 2: holds something else than numbers" in refused(own, bad)
    bad.write_text(HEAD + "1,0,0\n", encoding="utf-8")
    assert "line 2: has 3 values, but there are 9 columns" in refused(own, bad)
    geodetic(bad, [(1, 0.0, 0.0, 3), (1, 0.0, 0.0, 4)])
    assert "bad.csv: 1: it is at two places at 1 s" in refused(own, bad)
    done = call("convert", own, bad, own, good, "--skip-damaged", "--out", out)
    assert done.exit_code == 0 and "1 damaged encounters were skipped" in done.stdout
    assert read_set(out).numbers.tolist() == [1]
    out.unlink()
    (tmp_path / "none.mat").write_bytes(b"nothing")
    assert "is no MATLAB file" in refused(tmp_path / "none.mat")
    # SciPy reads on beyond the end of what is cut off, which ended the process.
    for packed in (False, True):
        savemat(tmp_path / "cut.mat", {"a": matrix(1)}, do_compression=packed)
        content = (tmp_path / "cut.mat").read_bytes()
        (tmp_path / "cut.mat").write_bytes(content[:-1])
        assert "is no MATLAB file of version 7 or less: an el" in refused(tmp_path / "cut.mat")
        kind = content[128:132]
        short = (len(content) - 137).to_bytes(4, "little")
        (tmp_path / "cut.mat").write_bytes(content[:128] + kind + short + content[136:-1])
        assert "cut off" in refused(tmp_path / "cut.mat") or not packed
    savemat(tmp_path / "other.mat", {"x": np.zeros((3, 9))})
    assert "holds no matrix of 7 rows" in refused(tmp_path / "other.mat")
    savemat(tmp_path / "events.mat", {"event": np.zeros((3, 4))})
    assert "holds events" in refused(tmp_path / "events.mat")
    states = np.zeros((1, 1), dtype=[("v_ftps", "O")])
    savemat(tmp_path / "object.mat", {"enc": MatlabObject(states, "ScriptedEncounter")})
    assert "MATLAB's class 'ScriptedEncounter'" in refused(tmp_path / "object.mat")
    twice = matrix(1)
    twice[0, 1] = twice[0, 0]
    savemat(tmp_path / "twice.mat", {"a": twice, "b": matrix(2)})
    assert "aircraft 1: it is at two places at" in refused(tmp_path / "twice.mat")


def test_rows_that_stand_there_again_count_once_and_are_put_in_order(tmp_path: Path) -> None:
    """As `traffic.csv` reads them: both tables and matrices give what the orderly ones do."""
    orderly = geodetic(tmp_path / "own.csv", OWN), geodetic(tmp_path / "other.csv", OTHER)
    assert call("convert", *orderly, "--out", tmp_path / "a.parquet").exit_code == 0
    mixed = geodetic(tmp_path / "mixed.csv", [OWN[0], OWN[2], OWN[1], OWN[2], OWN[2]])
    done = call("convert", mixed, orderly[1], "--out", tmp_path / "b.parquet")
    assert done.exit_code == 0
    assert f"note: {mixed}: 1: rows were not in the order of time and have been sorted" in (
        done.stderr.replace("\n", " ")
    )
    assert f"note: {mixed}: 1: 2 of its samples stand there again and count once" in (
        done.stderr.replace("\n", " ")
    )
    a, b = read_set(tmp_path / "a.parquet"), read_set(tmp_path / "b.parquet")
    for row in (0, 1):
        assert np.array_equal(np.stack(a.path(row)), np.stack(b.path(row)))
    savemat(tmp_path / "back.mat", {"a": matrix(1)[:, ::-1], "b": matrix(2)})
    savemat(tmp_path / "on.mat", {"a": matrix(1), "b": matrix(2)})
    for name in ("back", "on"):
        out = tmp_path / f"{name}.parquet"
        assert call("convert", tmp_path / f"{name}.mat", "--out", out).exit_code == 0
    back, on = (read_set(tmp_path / f"{name}.parquet") for name in ("back", "on"))
    assert np.array_equal(np.stack(back.path(0)), np.stack(on.path(0)))


def test_a_matlab_file_of_version_7_3_is_called_that(tmp_path: Path) -> None:
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    hdf5 = b"\x89HDF\r\n\x1a\n" + bytes(400)
    for content in (head.ljust(512, b"\0") + hdf5, hdf5):
        (tmp_path / "t.mat").write_bytes(content)
        done = call("convert", tmp_path / "t.mat", "--out", tmp_path / "s.parquet")
        assert done.exit_code == 2
        assert "is a MATLAB 7.3 file (HDF5), which is not read: save it" in done.stderr
        assert "cut off" not in done.stderr
