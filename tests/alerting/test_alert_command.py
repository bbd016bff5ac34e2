"""``dsa-des alert``: tables, figures, and errors that leave nothing behind."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from components.alerting.command import alert
from tests.alerting.conf_text import CONF
from tests.alerting.reference_data import rows

CONFIGS = Path(__file__).parents[2] / "configs"
DO365B = CONFIGS / "alerting" / "do365b.conf"

#: Head-on at 40 m/s each and one after the other at 30 ft: names and sizes are unequal.
XYZ = """\
NAME sx sy sz trk gs vs time
[none] [nmi] [nmi] [ft] [deg] [m/s] [fpm] [s]
"""


def call(*arguments: object) -> Result:
    return CliRunner().invoke(alert, [str(a) for a in arguments], catch_exceptions=False)


def head_on(path: Path, times: int = 4) -> Path:
    lines = [XYZ]
    for t in range(times):
        north = t * 40 / 1852
        lines.append(f"own 0 {north:.9f} 5000 0 40 0 {t}\n")
        lines.append(f"big bird, 0.1, {2.5 - north:.9f}, 5030, 180, 40, 0, {t}\n")
    path.write_text("".join(lines), encoding="utf-8")
    return path


def conf(tmp_path: Path, text: str = CONF) -> Path:
    path = tmp_path / "two.conf"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_with_names_units_and_rounded_numbers(tmp_path: Path) -> None:
    out = tmp_path / "alerts.csv"
    result = call(head_on(tmp_path / "a.xyz"), "--conf", conf(tmp_path), "--out", out)
    assert result.exit_code == 0, result.stderr
    found = rows(out.read_text(encoding="utf-8"))
    assert found[0][:6] == [
        "Time", "Ownship", "Traffic", "Alerter", "Alert Level", "Time to Volume of Alert(1)",
    ]  # fmt: skip
    assert found[1][8:12] == ["[ft]", "[knot]", "[fpm]", "[nmi]"]
    first = dict(zip(found[0], found[2], strict=True))
    assert (first["Ownship"], first["Traffic"], first["Alerter"]) == ("own", "big bird", "1")
    assert first["Vertical Separation"] == "30.0"
    assert first["Horizontal Separation"] == "2.501999"  # sqrt(0.1² + 2.5²) = 2.5019992
    assert first["Projected TCPA"] == "57.875"  # 2.5 nmi at 80 m/s
    assert first["Projected DCPA"] == "0.1"
    assert first["Projected TCOA"] == ""
    assert len(found) == 6


def test_the_levels_are_those_of_the_volumes(tmp_path: Path) -> None:
    """Level 2 is a cylinder of 2000 ft: entered at (2.5 nmi - root) / 80 m/s; due 25 s before."""
    out = tmp_path / "alerts.csv"
    path = head_on(tmp_path / "a.xyz", 40)
    said = call(path, "--conf", conf(tmp_path), "--out", out, "--no-hysteresis")
    assert said.exit_code == 0
    found = rows(out.read_text(encoding="utf-8"))[2:]
    entry_s = (2.5 * 1852 - ((2000 * 0.3048) ** 2 - 185.2**2) ** 0.5) / 80
    for row in found:
        left_s = entry_s - float(row[0])
        assert float(row[6]) == pytest.approx(left_s, abs=2e-6)
        assert row[4] == ("2" if left_s < 25 else "1")
    # Entered at 50.6 s; what is printed are the first instants of each level.
    assert re.search(r"a\.xyz\W+big bird\W+2\W+0\.0\W+26\.0\W", said.stdout), said.stdout


def test_several_encounters_fill_a_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    one, other = head_on(tmp_path / "in" / "a.xyz"), head_on(tmp_path / "in" / "b.daa")
    out, figures = tmp_path / "tables", tmp_path / "figures"
    arguments = ("--conf", conf(tmp_path), "--out", out, "--figure", figures)
    assert call(tmp_path / "in", *arguments).exit_code == 0
    assert sorted(p.name for p in out.iterdir() if p.suffix == ".csv") == ["a.csv", "b.csv"]
    assert (figures / "a.png").read_bytes().startswith(b"\x89PNG")
    single = tmp_path / "single.csv"
    assert call(one, "--conf", conf(tmp_path), "--out", single).exit_code == 0
    assert single.read_bytes() == (out / "a.csv").read_bytes() == (out / "b.csv").read_bytes()
    assert other.exists()


def test_a_figure_of_one_encounter(tmp_path: Path) -> None:
    figure = tmp_path / "a.png"
    arguments = ("--conf", conf(tmp_path), "--out", tmp_path / "a.csv", "--figure", figure)
    assert call(head_on(tmp_path / "a.xyz"), *arguments).exit_code == 0
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_the_configuration_of_the_project_alerts(tmp_path: Path) -> None:
    out = tmp_path / "alerts.csv"
    result = call(CONFIGS / "encounters/crossing.daa", "--conf", DO365B, "--out", out)
    assert result.exit_code == 0, result.stderr
    names = ("encounters/crossing.daa", "--conf", "alerting/do365b.conf", "--out")
    assert call(*names, tmp_path / "same.csv").exit_code == 0
    assert (tmp_path / "same.csv").read_bytes() == out.read_bytes()
    levels = [int(row[4]) for row in rows(out.read_text(encoding="utf-8"))[2:]]
    assert levels[0] == 2 and max(levels) == 3 and levels[-1] == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("= 30 [s]", "= 30"), "One_Two_far_WCV_TTHR has no unit"),
        (("hysteresis_time", "hysteresis_tim"), "did you mean 'hysteresis_time'"),
        (("= 500 [ft]", "= -500 [ft]"), "may not be negative"),
    ],
)
def test_a_bad_configuration_is_one_error_and_no_output(tmp_path, change, said) -> None:
    out = tmp_path / "alerts.csv"
    bad = conf(tmp_path, CONF.replace(*change))
    result = call(head_on(tmp_path / "a.xyz"), "--conf", bad, "--out", out)
    assert result.exit_code == 2
    assert said in result.stderr and "two.conf: line" in result.stderr
    assert not out.exists()


def test_bad_encounters_are_named_and_nothing_is_written(tmp_path: Path) -> None:
    good, bad = head_on(tmp_path / "a.xyz"), tmp_path / "b.xyz"
    bad.write_text(XYZ + "own 0 0 5000 0 forty 0 0\n", encoding="utf-8")
    still = tmp_path / "c.xyz"
    still.write_text("NAME sx sy sz time\n[none] [m] [m] [m] [s]\nown 0 0 9 0\nb 5 0 9 0\n")
    out = tmp_path / "tables"
    result = call(good, bad, still, "--conf", conf(tmp_path), "--out", out)
    assert result.exit_code == 2
    assert "'forty' is not a number" in result.stderr and "b.xyz" in result.stderr
    assert "c.xyz: there are no velocities" in result.stderr
    assert not out.exists()


def test_an_alerter_that_is_not_there(tmp_path: Path) -> None:
    path = head_on(tmp_path / "a.xyz", 1)
    text = path.read_text(encoding="utf-8").replace(" time\n", " time alerter\n")
    lines = text.replace(" [s]\n", " [s] [none]\n").splitlines()
    path.write_text("\n".join([*lines[:2], lines[2] + " 1", lines[3] + ", 3"]), encoding="utf-8")
    result = call(path, "--conf", conf(tmp_path), "--out", tmp_path / "a.csv")
    assert result.exit_code == 2
    assert "an alerter is 3: it must be a whole number from 1 to 2" in result.stderr


def test_files_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    paths = head_on(tmp_path / "a.xyz"), head_on(tmp_path / "in" / "a.daa")
    result = call(*paths, "--conf", conf(tmp_path), "--out", tmp_path / "tables")
    assert result.exit_code == 2 and "would both be written to a.csv" in result.stderr


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    result = call(tmp_path / "in", "--conf", conf(tmp_path), "--out", tmp_path / "tables")
    assert result.exit_code == 2 and "holds no .daa or .xyz file" in result.stderr


def test_alerters_that_are_not_named_are_ignored_with_one_note(tmp_path: Path) -> None:
    """As the reference does; the table is that of a file without them."""
    named = CONF.replace("alerters = One_Two, One", "alerters = One")
    alone = named.splitlines(keepends=True)
    tables = []
    for text in (named, "".join(line for line in alone if not line.startswith("One_Two"))):
        out = tmp_path / "alerts.csv"
        result = call(head_on(tmp_path / "a.xyz"), "--conf", conf(tmp_path, text), "--out", out)
        assert result.exit_code == 0, result.stderr
        tables.append((out.read_text(encoding="utf-8"), result.output.count("note:")))
        assert ("One_Two" in result.output) == (len(tables) == 1)
    assert tables[0][0] == tables[1][0]
    assert [notes for _, notes in tables] == [1, 0]


def test_a_slip_in_a_named_alerter_is_still_an_error(tmp_path: Path) -> None:
    text = CONF.replace("One_alert_1_region", "One_alert_1_regoin")
    result = call(
        head_on(tmp_path / "a.xyz"), "--conf", conf(tmp_path, text), "--out", tmp_path / "o.csv"
    )
    assert result.exit_code == 2
    assert "One_alert_1_regoin" in result.stderr


def table(path: Path, first: str = "time,id,lat,lon,alt,track,gs,vs", unit: str = "") -> Path:
    """Write a head-on encounter at 60 m/s each; the intruder is heard half a second off."""
    lines = [first + "\n", *([unit + "\n"] if unit else [])]
    for t in range(8):
        if t < 6:
            lines.append(f"{t + 100},own,{45 + 60 * t / 111120:.9f},7,1000,0,60,0\n")
        north = 0.1 - 60 * (t - 0.5) / 111120
        lines.append(f"{t + 99.5},other,{45 + north:.9f},7,1030,180,60,0\n")
    path.write_text("".join(lines), encoding="utf-8")
    return path


def test_tables_are_read_as_traffic_reads_them(tmp_path: Path) -> None:
    """In m and m/s where no unit is given; the target is where its flight is at each time of ours.

    They were taken for files of DAIDALUS, in feet and knots, or refused.
    """
    out = tmp_path / "alerts.csv"
    result = call(table(tmp_path / "tracks.csv"), "--conf", conf(tmp_path), "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "alt in m, gs in m/s, vs in m/s: no unit is given" in " ".join(result.stdout.split())
    assert "interpolated to the times of the ownship" in " ".join(result.stdout.split())
    heading, _, *lines = rows(out.read_text(encoding="utf-8"))
    found = [dict(zip(heading, line, strict=True)) for line in lines]
    assert [row["Time"] for row in found] == [f"{t}.0" for t in range(100, 106)]
    for t, row in enumerate(found):
        assert row["Traffic"] == "other"
        assert float(row["Projected TCPA"]) == pytest.approx((11112 - 120 * t) / 120, abs=0.01)
        assert float(row["Vertical Separation"]) == pytest.approx(30 / 0.3048, abs=1e-4)


def test_a_table_with_a_row_of_units_is_still_one_of_daidalus(tmp_path: Path) -> None:
    out, name = tmp_path / "alerts.csv", "time,name,lat,lon,alt,trk,gs,vs"
    path = table(tmp_path / "a.csv", name, "[s],[none],[deg],[deg],[ft],[deg],[m/s],[fpm]")
    result = call(path, "--conf", conf(tmp_path), "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "8 rows of targets are left out" in " ".join(result.stdout.split())


def test_a_table_without_anybody_at_our_times_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "apart.csv"
    path.write_text(
        "time,id,lat,lon,alt\n0,own,45,7,1000\n1,own,45.001,7,1000\n5,other,45,7,1000\n"
        "6,other,45.001,7,1000\n", encoding="utf-8",
    )  # fmt: skip
    result = call(path, "--conf", conf(tmp_path), "--out", tmp_path / "x.csv")
    assert result.exit_code == 2
    assert "no aircraft is there at a time at which own is" in result.stderr
