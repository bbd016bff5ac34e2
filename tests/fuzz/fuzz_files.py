"""Traffic files, aspect tables and meshes with something wrong in them."""

import random
from typing import Any

import fuzz_values
from fuzz_cases import Case
from fuzz_scenes import base_scene, command, damaged

from dsa_des.files.toml_files import to_toml

DAA = """NAME lat lon alt trk gs vs time
[none] [deg] [deg] [ft] [deg] [knot] [fpm] [s]
A, 52, 4, 3000, 0, 100, 0, 10
B, 52.03, 4, 3100, 180, 100, 0, 10
A, 52.0005, 4, 3000, 0, 100, 0, 11
B, 52.0295, 4, 3100, 180, 100, 0, 11
A, 52.001, 4, 3000, 0, 100, 0, 12
B, 52.029, 4, 3100, 180, 100, 0, 12
"""
XYZ = """NAME sx sy sz vx vy vz time
[none] [nmi] [nmi] [ft] [knot] [knot] [fpm] [s]
A 0 0 3000 0 100 0 0
B 0 2 3000 0 -100 0 0
A 0 0.03 3000 0 100 0 1
B 0 1.97 3000 0 -100 0 1
"""
CSV = """time,id,latitude,longitude,altitude_ft,heading,groundspeed_kt,vertrate_fpm
0,A,52,4,3000,0,100,0
0,B,52.03,4,3100,180,100,0
1.5,A,52.0005,4,3000,0,100,0
1.5,B,52.0295,4,3100,180,100,0
"""
RCS = "az_deg,el_deg,dbsm\n" + "".join(
    f"{az},{el},{az / 30 + el / 90}\n" for el in (-90, 0, 90) for az in range(0, 360, 45)
)
AREA = "az_deg,el_deg,area_m2\n" + "".join(
    f"{az},{el},{10 + az / 30}\n" for el in (-90, 0, 90) for az in range(0, 360, 45)
)
MESH = "".join(
    f"v {x} {y} {z}\n" for x, y, z in ((0, 0, 0), (4, 0, 0), (0, 3, 0), (0, 0, 2))
) + "f 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"  # fmt: skip
STL = "solid a\n" + "".join(
    "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {p}\n" for p in three)
    + "endloop\nendfacet\n"
    for three in (
        ("0 0 0", "4 0 0", "0 3 0"), ("0 0 0", "4 0 0", "0 0 2"),
        ("4 0 0", "0 3 0", "0 0 2"), ("0 0 0", "0 3 0", "0 0 2"),
    )
) + "endsolid a\n"  # fmt: skip

CELLS = (
    "", "nan", "inf", "-inf", "1e400", "1e9", "1e12", "1e300", "-1e300", "1e-320", "1_000", "0x1f",
    "90", "-90", "90.0001", "180", "-180", "360", "1080", "1e6", "x" * 140000, '"', '"a', "'", "#",
    "9" * 5000, "1,5", "1;5", "٣", "\x1b[2J", "2024-01-01T00:00:00Z", "9999-12-31T23:59:59",
    "0001-01-01T00:00:00+23:59", "--", "-", "+", "1e", ".", "١٢", "10:20:30", "A", "B", "C", "-0.0",
    "1e5", "86400", "86399", "200000", "4e9", "1.0000000000001", "a\tb", "\u2028", "\x85", "\x0c",
)  # fmt: skip


def spoiled(rng: random.Random, text: str) -> bytes:
    """Return a table with one to three cells, rows or bytes changed."""
    lines = text.splitlines()
    separator = "," if "," in lines[-1] else " "
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        at = rng.randrange(len(lines))
        cells = lines[at].split(separator)
        kind = rng.random()
        if kind < 0.55:
            cells[rng.randrange(len(cells))] = (
                rng.choice(CELLS) if rng.random() < 0.6 else str(fuzz_values.number(rng))[:400]
            )
            lines[at] = separator.join(cells)
        elif kind < 0.62:
            del lines[at]
        elif kind < 0.7:
            lines.insert(rng.randrange(len(lines)), lines[at])
        elif kind < 0.76:
            lines[at] = separator.join(cells[:-1])
        elif kind < 0.82:
            lines[at] += separator + rng.choice(CELLS)
        elif kind < 0.88:
            rng.shuffle(lines)
        elif kind < 0.92:
            lines[at] = rng.choice((",", ";", "\t", " ", ", ")).join(cells)
        elif kind < 0.95:
            lines[at] = rng.choice(CELLS)
        else:
            lines = lines[: rng.choice((0, 1, 2, 3))]
        if not lines:
            break
    data = "\n".join(lines).encode("utf-8", "surrogatepass") + b"\n"
    return damaged(rng, data) if rng.random() < 0.25 else data


def put_file(rng: random.Random, case: Case, name: str, text: str) -> None:
    """Add a spoiled file, or something that is no file."""
    kind = rng.random()
    if kind < 0.92:
        case.files[name] = spoiled(rng, text)
    elif kind < 0.94:
        case.files[f"|{name}"] = b""
    elif kind < 0.96:
        case.files[f"{name}/x"] = b""
    elif kind < 0.99:
        target = rng.choice((name.encode(), b"/dev/zero", b"/dev/full", b"/proc/self/mem", b"none"))
        case.files[f"@{name}"] = target


def file_case(rng: random.Random, case: Case) -> Case:
    """Return a scene that names a spoiled file, or a comparison with a spoiled mesh or table."""
    kind = rng.random()
    scene = base_scene(rng)
    blocks: dict[str, Any] = scene["blocks"]
    if kind < 0.55:
        name, text, type_name = rng.choice((
            ("t.daa", DAA, "traffic.daa_file"), ("t.xyz", XYZ, "traffic.daa_file"),
            ("t.csv", CSV, "traffic.csv"),
        ))  # fmt: skip
        put_file(rng, case, name, text)
        blocks["traffic"] = {"type": type_name, "file": name}
        if rng.random() < 0.7:
            del scene["duration_s"]
    elif kind < 0.85:
        craft = {"name": "a", "east_m": 60, "north_m": 3000, "up_m": 30, "heading_deg": 180}
        if rng.random() < 0.5:
            put_file(rng, case, "rcs.csv", RCS)
            craft["rcs_table"] = "rcs.csv"
        else:
            put_file(rng, case, "area.csv", AREA)
            craft["eo"] = {
                "front_m2": 1, "side_m2": 2, "horizontal_m2": 3, "silhouette_table": "area.csv"
            }  # fmt: skip
            blocks["eo"]["silhouette"] = "aspect_table"
        traffic = {
            "type": "traffic.scripted",
            "ownship": {"lat_deg": 5, "lon_deg": 4, "alt_m": 900},
        }
        blocks["traffic"] = {**traffic, "intruders": [craft]}
    else:
        return _comparison(rng, case)
    case.files["scene.toml"] = to_toml(scene).encode()
    case.argv = command(rng, "scene.toml")
    return case


def _comparison(rng: random.Random, case: Case) -> Case:
    suffix, text = rng.choice(((".obj", MESH), (".stl", STL), (".ply", MESH), (".zip", STL)))
    case.argv = ["compare-silhouettes", "--areas", "1,2,3", "--out", "out", "--step-deg", "90"]
    if rng.random() < 0.7:
        put_file(rng, case, f"m{suffix}", text)
        case.argv += ["--mesh", f"m{suffix}"]
    else:
        put_file(rng, case, "area.csv", AREA)
        case.argv += ["--reference", "area.csv"]
    if rng.random() < 0.1:
        case.argv[2] = rng.choice(("1,2", "nan,1,1", "inf,1,1", "-1,1,1", "1e308,1,1", "a,b,c"))
    return case
