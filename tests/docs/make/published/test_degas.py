"""DEGAS's encounter through our chain, against what it recorded."""

import numpy as np
import pytest
from reference_data import reference_text

import dsa_des
from docs.make.published import __main__ as maker
from docs.make.published import degas, degas_bands, degas_sensors
from docs.make.published.degas_sensors import quantiles

PAGE = maker.PAGE.read_text(encoding="utf-8").splitlines()
FOOT_M = 0.3048


def recorded(case):
    """Return the columns of a flight that DEGAS recorded at 10 Hz."""
    lines = reference_text(f"published/degas/trajectory_{case}.csv.gz").splitlines()
    return dict(zip(lines[0].split(","), np.loadtxt(lines[1:], delimiter=",").T, strict=True))


def test_every_row_of_the_scenes_is_equal_and_on_the_page():
    rows = [*degas.unmitigated(), *degas.mitigated()]
    assert len(rows) == 10
    for row in rows:
        assert row.verdict == "equal", row.line()
        assert row.line() in PAGE


def test_the_pilot_turns_twice_and_to_tracks_of_five_degrees():
    told = dsa_des.run(degas.SCENE)["manoeuvres"].to_pylist()
    assert [row["time_s"] for row in told] == [97.0, 107.0]
    assert [np.degrees(row["heading_rad"]) for row in told] == pytest.approx([20.0, 25.0])


def test_the_ownship_flies_where_theirs_flew():
    truth = dsa_des.run(degas.SCENE)["truth"]
    own = truth.filter(truth["target"].is_null())
    time_s, theirs = own["time_s"].to_numpy(), recorded("int_perf")
    last = np.searchsorted(theirs["time_s"], time_s)
    # Half a tenth of a second lies between a step of Euler and its heading.
    heading = np.degrees(np.unwrap(own["heading_rad"].to_numpy()))
    ours = np.interp(theirs["time_s"][:-3] + 0.05, time_s, heading)
    until = int(last[-1]) - 3
    assert np.abs(ours - np.degrees(theirs["own_psi_rad"][:-3]))[:until].max() < 0.02
    # A degree is 6378137 and 6335439 m times pi / 180 at the equator, and a level flight above it.
    alt_m = own["alt_m"].to_numpy()
    east = np.radians(own["lon_deg"].to_numpy()) * (6378137.0 + alt_m) / FOOT_M
    north = np.radians(own["lat_deg"].to_numpy()) * (6335439.3 + alt_m) / FOOT_M
    assert np.abs(east - theirs["own_east_ft"][last]).max() < 0.5
    assert np.abs(north - theirs["own_north_ft"][last]).max() < 0.5


def test_its_flights_from_a_file_give_the_same(tmp_path):
    nominal = recorded("nom")
    lines = ["NAME, sx, sy, sz, vx, vy, vz, time", "none, [ft], [ft], [ft], [m/s], [m/s], [m/s], s"]
    for k in range(0, len(nominal["time_s"]), 10):
        for name, short in (("own", "own"), ("other", "int")):
            speed = nominal[f"{short}_speed_ftps"][k] * FOOT_M
            psi = nominal[f"{short}_psi_rad"][k]
            place = (nominal[f"{short}_{axis}_ft"][k] for axis in ("east", "north", "up"))
            values = [*place, speed * np.sin(psi), speed * np.cos(psi), 0.0, nominal["time_s"][k]]
            lines.append(", ".join([name, *(f"{value:.9f}" for value in values)]))
    (tmp_path / "nominal.xyz").write_text("\n".join(lines) + "\n", encoding="utf-8")
    scene = tmp_path / "filed.toml"
    scene.write_text(
        'extends = "published/degas"\n[blocks]\nremove = ["traffic"]\n[blocks.traffic]\n'
        'type = "traffic.daa_file"\nfile = "nominal.xyz"\n',
        encoding="utf-8",
    )
    for row in degas.mitigated(scene):
        assert row.verdict == "equal", row.line()


def test_bands_are_not_spoken_of_without_their_record(tmp_path):
    assert "equal" not in degas_bands.text(tmp_path / "degas")


def test_the_middle_99_percent_are_of_the_runs_that_have_a_value():
    values = [*range(1, 200), float("nan")]
    assert quantiles(values) == pytest.approx((1.99, 100.0, 198.01))


def test_the_study_of_sensors_gives_its_table(tmp_path):
    """In short form: one seed of each sensor."""
    runs = dsa_des.study(
        degas_sensors.STUDY, sets=["set.duration_s=140"], replicas=1, workers=1
    ).runs
    found = degas_sensors.lines(runs)
    assert len(found) == 2 + len(degas_sensors.SENSORS)
    assert all(line.count("|") == 6 for line in found)
    first = runs["first_alert_time_s.filter"].to_numpy()
    assert ((first > 60.0) & (first < 125.0)).all()
    acted = runs["first_manoeuvre_time_s"].to_numpy(zero_copy_only=False)
    assert (acted >= first + 8.0).all()
    degas_sensors.draw(tmp_path / "spread.png", runs)
    assert (tmp_path / "spread.png").stat().st_size > 10_000
