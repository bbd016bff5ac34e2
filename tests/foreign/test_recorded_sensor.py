"""Measurements of a run, read back in the sensor's place: what comes after it cannot tell."""

import copy

import crooked
import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
import pytest
from covering import covers
from wired import chain

import dsa_des
from dsa_des.errors import SceneError

STATED = {"errors": "stated", "quantised": False, "azimuth_error_deg": 0.3,
          "elevation_error_deg": 0.4}  # fmt: skip
PULSE = {**STATED, "type": "radar.range_boundary", "range_km": 20.0, "range_error_m": 15.0,
         "scan_rate_hz": 5, "latency_s": "0.37"}  # fmt: skip
EYE = {**STATED, "type": "optical.range_boundary", "range_km": 2.2, "scan_rate_hz": 7,
       "offset_s": "0.03", "latency_s": "0.02"}  # fmt: skip
NEAR = {**crooked.ROLLING, "name": "near", "east_m": -900.0, "north_m": -600.0}


def scene(fusion="fusion.pass_through", tracker="tracking.ekf", **pulse):
    return chain(
        {"pulse": {**PULSE, **pulse}, "eye": EYE}, targets=[crooked.ROLLING, NEAR], duration_s=4,
        fusion={"type": fusion}, tracker={"type": tracker},
    )  # fmt: skip


def replayed(of, **keys):
    """The scene with the measurements of a run in place of its radar."""
    found = copy.deepcopy(of)
    found["blocks"]["pulse"] = {"type": "sensor.recorded", "block": "pulse", **keys}
    return found


def late_rows(folder, file, late_s):
    """Write detections and empty looks of the radar into one table, with their arrivals."""
    detections = pq.read_table(folder / "detections.parquet").to_pylist()
    scans = pq.read_table(folder / "scans.parquet").to_pylist()
    rows = [r for r in detections if r["block"] == "pulse"]
    seen = {r["tick"] for r in rows}
    names = list(rows[0])
    pose = [name for name in scans[0] if name.startswith("own_")]
    own = {r["tick"]: {n: r[n] for n in pose} for r in scans if r["block"] == "pulse"}
    empty = [r for r in scans if r["block"] == "pulse" and r["tick"] not in seen]
    rows += [{**dict.fromkeys(names), **{n: r[n] for n in ("block", "tick", "time_s", "scan")}}
             for r in empty]  # fmt: skip
    rows = sorted(({**r, **own[r["tick"]]} for r in rows), key=lambda r: r["tick"])
    for row in rows:
        row["arrival_s"] = row["time_s"] + late_s
    table = pa.Table.from_pylist(rows, schema=None)
    if file.suffix == ".csv":
        pacsv.write_csv(table, file)
    else:
        pq.write_table(table, file)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    dsa_des.run(scene(), out=folder / "was")
    return folder / "was"


@covers("file", "block", "model", of=("sensor.recorded",))
@pytest.mark.parametrize("fusion", ["fusion.pass_through", "fusion.gated"])
@pytest.mark.parametrize("kind", ["folder", ".parquet", ".csv"])
def test_tracks_are_those_of_the_run_to_the_byte(recorded, tmp_path, kind, fusion):
    if kind == "folder":
        keys = {"file": str(recorded), "latency_s": "0.37"}
    else:
        file = tmp_path / f"measured{kind}"
        late_rows(recorded, file, 0.37)
        keys = {"file": str(file), "model": str(recorded / "scene.toml")}
    was = dsa_des.run(scene(fusion))
    again = dsa_des.run(replayed(scene(fusion), **keys))
    for name in ("state_tracks", "fused", "detections"):
        before, after = (getattr(run, name) for run in (was, again))
        assert before.num_rows > 20
        assert before.to_pylist() == after.to_pylist(), name


def test_looks_that_overtake_each_other_arrive_in_their_own_order(tmp_path):
    file = tmp_path / "measured.csv"
    file.write_text(
        "time_s,arrival_s,azimuth_rad,elevation_rad,range_m\n"
        "0.1,0.9,0.5,0.0,4000\n0.2,0.3,0.5,0.0,3990\n0.2,0.3,,,\n0.3,,,,\n"
    )
    run = dsa_des.run(
        {
            "duration_s": 1, "seed": 1, "wires": ["radar -> fusion"],
            "blocks": {
                "radar": {"type": "sensor.recorded", "file": str(file)},
                "fusion": {"type": "fusion.pass_through"},
            },
        }
    )  # fmt: skip
    fused = run.fused.to_pylist()
    assert [(r["time_s"], r["measured_s"], r["range_m"]) for r in fused] == [
        (0.3, 0.2, 3990.0), (0.9, 0.1, 4000.0)
    ]  # fmt: skip
    assert run.scans.column("detected").to_pylist() == [1, 1, 0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,azimuth_rad\n0,1\n", "there is no column 'elevation_rad'"),
        ("time_s,azimuth_rad,elevation_rad\n1,0,0\n0.5,0,0\n", "line 3, column time_s: 0.5 comes"),
        ("time_s,azimuth_rad,elevation_rad\n1,nan,0\n", "line 2, column azimuth_rad: 'nan'"),
        ("time_s,azimuth_rad,elevation_rad\n1,,0\n", "line 2, column elevation_rad: azimuth and"),
        ("time_s,azimuth_rad,elevation_rad\n,1,0\n", "line 2, column time_s: a finite"),
        ("time_s,azimuth_rad,elevation_rad\n1,1,0\n1,2\n", "line 3: has 2 values"),
        ("time_s,arrival_s,azimuth_rad,elevation_rad\n1,.9,1,0\n", "is before time_s"),
        ("time_s,azimuth_rad,elevation_rad\n", "there are no rows"),
        ("time_s,azimuth_rad,elevation_rad,target\n1,1,0,rollin\n", "line 2: target 'rollin' is"),
        ("time_s,azimuth_rad,elevation_rad,own_lat_deg\n1,1,0,3\n", "pose lacks own_lon_deg"),
        ("block,time_s,azimuth_rad,elevation_rad\na,1,1,0\nb,1,1,0\n", "no rows of block 'pulse'"),
    ],
)
def test_what_is_wrong_is_said_with_file_and_line(tmp_path, text, said):
    file = tmp_path / "measured.csv"
    file.write_text(text)
    with pytest.raises(SceneError) as error:
        dsa_des.run(replayed(scene(), file=str(file)))
    assert said in str(error.value) and str(file) in str(error.value)


def test_a_number_that_is_none_in_parquet_is_said_with_its_row(tmp_path):
    file = tmp_path / "measured.parquet"
    columns = {"time_s": [0.0, 1.0], "azimuth_rad": [0.0, np.nan], "elevation_rad": [0.0, 0.0]}
    pq.write_table(pa.table(columns), file)
    with pytest.raises(SceneError, match="row 2, column azimuth_rad: nan"):
        dsa_des.run(replayed(scene(), file=str(file)))


@covers("scan_rate_hz", of=("sensor.recorded",))
@pytest.mark.parametrize("rate_hz", [2, None])
def test_traffic_beside_the_recording_flies_by_its_nominal_rate(tmp_path, rate_hz):
    file = tmp_path / "measured.csv"
    file.write_text("time_s,azimuth_rad,elevation_rad\n0.3,0.5,0.0\n")
    measured = {"type": "sensor.recorded", "file": str(file)}
    alone = chain(
        {"pulse": {**measured, **({"scan_rate_hz": rate_hz} if rate_hz else {})}},
        fusion={"type": "fusion.pass_through"},
    )
    if rate_hz is None:
        with pytest.raises(SceneError, match="none of them has a scan clock"):
            dsa_des.run(alone)
    else:
        times = dsa_des.run({**alone, "duration_s": 2}).truth.column("time_s").to_pylist()
        assert sorted(set(times)) == [0.0, 0.5, 1.0, 1.5]


@covers(
    "azimuth_error_deg", "elevation_error_deg", "range_error_m", of=("sensor.recorded",)
)  # fmt: skip
def test_plots_in_asterix_are_those_of_the_run_within_its_bits(recorded, tmp_path):
    pytest.importorskip("asterix", reason="needs the extra asterix")
    from click.testing import CliRunner

    from components.export.command import export

    file = tmp_path / "was.ast"
    done = CliRunner().invoke(export, [str(recorded), "--to", "asterix", "--out", str(file)])
    assert done.exit_code == 0, done.output
    run = dsa_des.run(
        {
            "seed": 1, "wires": ["radar -> fusion -> tracker"], "weather": {"qnh_hpa": 1000},
            "blocks": {
                "radar": {"type": "sensor.recorded", "file": str(file), "range_error_m": 15,
                          "azimuth_error_deg": 0.3, "elevation_error_deg": 0.4},
                "fusion": {"type": "fusion.pass_through"},
                "tracker": {"type": "tracking.ekf"},
            },
        }
    )  # fmt: skip
    was = pq.read_table(recorded / "detections.parquet").to_pylist()
    was = [row for row in was if row["block"] == "pulse"]
    now = run.detections.to_pylist()
    assert len(now) == len(was) > 20
    for before, after in zip(was, now, strict=True):
        assert abs(after["range_m"] - before["range_m"]) <= 1852 / 512 + 1e-6
        assert abs(after["time_s"] + was[0]["time_s"] - before["time_s"]) <= 1 / 128
    assert run.state_tracks.num_rows > 20
    assert any("flight levels, taken for heights" in note for note in run.info["notes"])
    stated = [np.radians(0.3) ** 2, np.radians(0.4) ** 2, 225.0]
    names = ("azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2")
    assert [now[0][name] for name in names] == pytest.approx(stated)
