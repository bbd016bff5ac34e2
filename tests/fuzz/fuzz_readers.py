"""Encounters, tables and run folders with something wrong in them, for all commands that read one.

Text is spoiled cell by cell, binary files byte by byte, Parquet files column by column.
"""

import io
import json
import random
import struct
from collections.abc import Callable
from typing import Any

from fuzz_cases import Case
from fuzz_files import CELLS, DAA, spoiled
from fuzz_scenes import damaged

GEODETIC = """ID,Time,lat,lon,alt_MSL_ft
1,0,41,-71,3000
1,1,41.001,-71,3010
2,0,41.01,-71,3000
2,1,41.009,-71,3100
"""
PLANE = "time_s,x_ft,y_ft,z_ft\n0,0,0,3000\n1,200,0,3000\n2,400,5,3001\n"
PAIRED = """NAME,east,north,alt,trk,gs,vs,time
[none],[ft],[ft],[ft],[rad],[ft/s],[ft/s],[s]
OWN,0,0,3000,0,200,0,0
OWN,0,200,3000,0,200,0,1
INT,100,900,3100,3.1,200,0,0
INT,100,700,3100,3.1,200,0,1
"""
PAIRS = "encounter,weight,n,m,miss\n1,0.5,1,0,40\n2,2.0,1,1,95\n3,1.5,0,1,170\n"
MADE = """closest_s = 10
duration_s = 20
horizontal_ft = [200, -200]
vertical_ft = 50
bearing_deg = { uniform = [10, 70] }
own_speed_kt = 120
intruder_speed_kt = 140
geometry = "any"
at = [-41.3, 174.8]
count = 2
weight = 1
"""
SET: dict[str, list[Any]] = {
    "encounter": [3, 3, 7, 7], "weight": [1.5, 1.5, 0.5, 0.5], "aircraft": ["own", "a", "own", "b"],
    "time_s": [[0.0, 1.0, 2.5]] * 4, "north_m": [[0.0, 50.0, 99.0]] * 4,
    "east_m": [[5.0, 5.0, 6.0]] * 4, "altitude_m": [[100.0, 110.0, 120.0]] * 4,
}  # fmt: skip
EVENTS: dict[str, list[Any]] = {
    "encounter": [3, 3], "weight": [1.5, 1.5], "aircraft": ["own", "a"], "north_m": [0.0, 900.0],
    "east_m": [0.0, 0.0], "altitude_m": [900.0, 930.0], "speed_mps": [50.0, 60.0],
    "heading_rad": [0.0, 3.0], "duration_s": [20.0, 20.0], "time_s": [[0.0, 5.0]] * 2,
    "climb_mps": [[0.0, 1.0]] * 2, "turn_rad_s": [[0.0, 0.05]] * 2,
    "acceleration_mps2": [[0.0, 0.0]] * 2, "geometry": ["head-on"] * 2, "family": [3, 3],
}  # fmt: skip
_POSE = {
    "own_lat_deg": [-34.0] * 2, "own_lon_deg": [18.0] * 2, "own_alt_m": [900.0] * 2,
    "own_heading_rad": [1.0] * 2, "own_pitch_rad": [0.0] * 2, "own_roll_rad": [0.1] * 2,
}  # fmt: skip
RUN: dict[str, dict[str, list[Any]]] = {
    "truth": {
        "tick": [0, 0], "block": ["traffic"] * 2, "target": [None, "a"], "time_s": [0.0, 0.0],
        "lat_deg": [-34.0, -34.01], "lon_deg": [18.0] * 2, "alt_m": [900.0] * 2,
        **{f"velocity_{axis}_m_s": [1.0, 2.0] for axis in ("north", "east", "down")},
        "heading_rad": [0.0, 1.0], "pitch_rad": [0.0] * 2, "roll_rad": [0.0] * 2,
    },
    "detections": {
        "tick": [0, 1], "block": ["radar", "eo"], "target": ["a", None], "time_s": [0.0, 1.0],
        "scan": [0, 1], "azimuth_rad": [0.1, 0.2], "elevation_rad": [0.0] * 2,
        "range_m": [900.0, None], **_POSE,
    },
    "scans": {
        "tick": [0, 1], "block": ["radar", "eo"], "time_s": [0.0, 1.0], "scan": [0, 1],
        "detected": [1, 1], **_POSE,
    },
}  # fmt: skip
ODD = (None, float("nan"), float("inf"), -1, 0, 1e300, -1e300, 500.0, 2**62, "x", "", True, [1.0])


def reader_case(rng: random.Random, case: Case) -> Case:
    """Return a spoiled file or run folder, and a command that reads it."""
    make: Callable[[random.Random, Case], None] = rng.choice(
        (_tracks, _tracks, _set, _set, _risk, _made, _run, _run)
    )
    make(rng, case)
    return case


def _parquet(rng: random.Random, columns: dict[str, list[Any]], metadata: Any = None) -> bytes:
    """Return a Parquet file in which a column, a cell, the metadata or a byte is wrong."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = {name: list(values) for name, values in columns.items()}
    kind, name = rng.random(), rng.choice(list(found))
    if kind < 0.2:
        del found[name]
    elif kind < 0.3:
        found[rng.choice(("other", f"{name}x", ""))] = found.pop(name)
    elif kind < 0.75:
        at, odd = rng.randrange(len(found[name])), rng.choice(ODD)
        cell = found[name][at]
        if isinstance(cell, list) and rng.random() < 0.7:
            cell = list(cell)
            cell[rng.randrange(len(cell))] = odd
            odd = rng.choice((cell, cell[:-1], []))
        found[name][at] = odd
        if rng.random() < 0.3:
            found[name] = [odd] * len(found[name])
    elif kind < 0.8:
        found = {name: values[:0] for name, values in found.items()}
    try:
        table = pa.table(found)
    except (pa.ArrowException, TypeError, OverflowError):
        table = pa.table({n: [str(v) for v in vs] for n, vs in found.items()})
    if metadata is not None:
        table = table.replace_schema_metadata({b"dsa_des.encounters": metadata})
    stream = io.BytesIO()
    pq.write_table(table, stream)
    content = stream.getvalue()
    return damaged(rng, content) if rng.random() < 0.1 else content


def _set(rng: random.Random, case: Case) -> None:
    meta = rng.choice((
        None, b"", b"{", b"null", b"[]", b'"x"', b'{"reference_deg": [500, 0]}', b"\xff",
        b'{"reference_deg": [41, -71]}', b'{"reference_deg": 5}', b"[" * 100000,
    ))  # fmt: skip
    case.files["s.parquet"] = _parquet(rng, rng.choice((SET, EVENTS)), meta)
    more = ["--skip-damaged"] * (rng.random() < 0.4)
    case.argv = rng.choice((
        ["encounters", "show", "s.parquet", *more],
        ["encounters", "convert", "s.parquet", "--out", "o.bin", *more],
        ["encounters", "convert", "s.parquet", "--at", "41", "-71", "--out", "o.parquet", *more],
        ["encounters", "split", "s.parquet", "--levels", "8,2", "--copies", "1,2,4", "--out",
         "o.parquet"],
    ))  # fmt: skip


def _tracks(rng: random.Random, case: Case) -> None:
    kind = rng.choice(("geo.csv", "plane.csv", "p.txt", "w.bin", "m.mat"))
    files = [kind]
    if kind == "w.bin":
        case.files[kind] = damaged(rng, _waypoints())
    elif kind == "m.mat":
        case.files[kind] = damaged(rng, _matrices(rng))
    else:
        text = {"geo.csv": GEODETIC, "plane.csv": PLANE, "p.txt": PAIRED}[kind]
        content = spoiled(rng, text)
        if rng.random() < 0.15:
            content = content.replace(b"\n", rng.choice((b"\r", b"\r\n", b"\n\r", b"\0")))
        case.files[kind] = content
        if kind == "plane.csv":
            case.files["second.csv"] = PLANE.encode()
            files.append("second.csv")
    case.argv = ["encounters", "convert", *files, "--out", "o.parquet"]
    if rng.random() < 0.3:
        case.argv = ["encounters", "show", *files]
    if rng.random() < 0.3:
        case.argv.append("--skip-damaged")


def _waypoints() -> bytes:
    head = struct.pack("<II", 1, 2) + struct.pack("<6d", 0, 0, 3000, 900, 0, 3100)
    tracks = (struct.pack("<H8d", 2, 1, 200, 0, 3000, 2, 400, 0, 3000) for _ in range(2))
    return head + b"".join(tracks)


def _matrices(rng: random.Random) -> bytes:
    import numpy as np
    from scipy.io import savemat

    track = np.outer(np.ones(7), np.arange(4.0)) + 1.0
    wrong = rng.choice((track, track[:6], track * np.nan, track[:, :1], track.astype(str)))
    stream = io.BytesIO()
    content = {"a1": track, "a2": wrong, "c": np.array([{"x": track}, "x"], dtype=object)}
    savemat(stream, content, do_compression=rng.random() < 0.5)
    return stream.getvalue()


def _risk(rng: random.Random, case: Case) -> None:
    case.files["t.csv"] = spoiled(rng, PAIRS)
    case.argv = ["encounters", "risk", "t.csv", "--nominal", "n", "--mitigated", "m"]
    for more in (
        ["--weight", "weight"], ["--by", "miss", "--edges", rng.choice(("50,150", "nan", "9,1"))],
        ["--interval", rng.choice(("gamma", "delta", "bootstrap")), "--resamples", "100"],
        ["--cluster", "encounter"], ["--json"], ["--skip-damaged"],
    ):  # fmt: skip
        case.argv += more * (rng.random() < 0.5)


def _made(rng: random.Random, case: Case) -> None:
    lines = MADE.splitlines()
    at = rng.randrange(len(lines))
    value = rng.choice((*CELLS, "[]", "{}", "[1, 'x']", "{uniform=[2,1]}", "true", "[[1]]", "1e9"))
    key = lines[at].split(" = ")[0]
    # So many take minutes, which is said of no such file.
    value = rng.choice(("0", "-1", "1e6", "true", "[1]", "99999999")) if key == "count" else value
    lines[at] = f"{key} = {value}"
    case.files["made.toml"] = "\n".join(lines).encode("utf-8", "surrogatepass")
    case.argv = ["encounters", "generate", "--made", "made.toml", "--out", "o.parquet"]


def _run(rng: random.Random, case: Case) -> None:
    if rng.random() < 0.15:
        case.files["t.daa"] = spoiled(rng, DAA)
        case.argv = ["view", "t.daa", "--out", "page.html"]
        return
    wrong = rng.choice((*RUN, "run.json"))
    for name, columns in RUN.items():
        import pyarrow as pa
        import pyarrow.parquet as pq

        stream = io.BytesIO()
        pq.write_table(pa.table(columns), stream)
        sound = stream.getvalue()
        case.files[f"r/{name}.parquet"] = _parquet(rng, columns) if name == wrong else sound
    info = json.dumps({"duration_s": 2.0, "seed": 1}).encode()
    if wrong == "run.json":
        info = rng.choice((b"", b"[]", b"null", b'{"duration_s": "x"}', b'{"duration_s": null}'))
    case.files["r/run.json"] = info
    to = rng.choice(("csv", "kml", "czml", "daa", "mat", "operator-csv"))
    case.argv = ["export", "r", "--to", to, "--out", "o"]
    if rng.random() < 0.4:
        case.argv = ["view", "r", "--out", "page.html"]
