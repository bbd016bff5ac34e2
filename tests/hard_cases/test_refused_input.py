"""Input that must be refused with one message, exit code 2 and nothing left behind.

Each case once ended in a traceback, a hang or a wrong exit code.
"""

import os

import pytest
from click.testing import CliRunner

from dsa_des.cli import main

NINES = "9" * 5000
DEEP = "[" * 3000
SCENE = "FIRST_LIGHT"
OUT = ["--duration", "5", "--quiet", "--out", "o"]
RUN = ["run", SCENE, *OUT]


def extending(count, text):
    """Return files c0.toml, c1.toml ... each of which extends the next."""
    files = {f"c{i}.toml": text.format(next=f"c{i + 1}.toml") for i in range(count)}
    return files | {f"c{count}.toml": 'title = "x"'}


def set_(key, value, *more):
    """Return a check of the first scene with one value changed."""
    return ["check", SCENE, *more, "--set", f"{key}={value}"]


# Name: files (text, bytes, @ a symbolic link, | a pipe), arguments, what the message must hold.
CASES = {
    "nested arrays": ({"a.toml": "a = " + DEEP}, ["check", "a.toml"], "nested too deeply"),
    "nested tables": ({"a.toml": "a." * 3000 + "a = 1"}, ["check", "a.toml"], "nested too deeply"),
    "nested within limits of Python": (
        {"a.toml": "a." * 100 + "a = 1"}, ["check", "a.toml"], "at most 64 inside each other",
    ),
    "huge integer": ({"a.toml": f"seed = {NINES}"}, ["check", "a.toml"], "too many digits"),
    "huge hexadecimal": (
        {"a.toml": "seed = 0x" + "f" * 5000}, ["check", "a.toml"], "too many digits",
    ),
    "huge integer in --set": ({}, set_("seed", NINES), "seed: a whole number has too many digits"),
    "huge index in --set": ({}, set_(f"wires[{NINES}].delay_s", 1), "there is no item"),
    "nested --set": ({}, set_("seed", DEEP), "nested too deeply"),
    "deep key in --set": ({}, set_("blocks.radar" + ".a" * 3000, 1), "nested too deeply"),
    "huge exponent": ({}, ["check", SCENE, "--duration", "1e99999999"], "of at most 60 digits"),
    "tiny exponent": ({}, set_("blocks.radar.scan_rate_hz", '"1e-9999999"'), "of at most 60"),
    "many digits": ({}, set_("blocks.radar.offset_s", f'"1/{NINES}"'), "of at most 60 digits"),
    "NUL in extends": ({"a.toml": 'extends = "a\\u0000b"'}, ["check", "a.toml"], "NUL"),
    "long extends": ({"a.toml": f'extends = "{"x" * 5000}"'}, ["check", "a.toml"], "too long"),
    "long scene name": ({}, ["check", "x" * 5000], "file name too long"),
    "symlink loop": (
        {"a.toml": 'extends = "loop"', "@loop": "loop"}, ["check", "a.toml"], "symbolic links",
    ),
    "doubling extends": (
        extending(25, 'extends = ["{next}", "{next}"]'), ["check", "c0.toml"], "than 20,000,000",
    ),
    "long chain": (extending(1200, 'extends = "{next}"'), ["check", "c0.toml"], "at most 32"),
    "a device": ({"a.toml": 'extends = "/dev/zero"'}, ["check", "a.toml"], "is a device"),
    "a field of view between two grid points": (
        {},
        set_("blocks.radar.azimuth_deg", "[20.1, 20.2]",
             "--set", "blocks.radar.azimuth_resolution_deg=5"),
        "azimuth_resolution_deg = 5: a multiple of it must lie in the field of view, "
        "azimuth_deg = [20.1, 20.2]",
    ),
    "a field of view below the first grid point": (
        {},
        set_("blocks.ir.elevation_deg", "[0.5, 4.5]",
             "--set", "blocks.ir.elevation_resolution_deg=5"),
        "a multiple of it must lie in the field of view, elevation_deg = [0.5, 4.5]",
    ),
    "a pipe": ({"|p": ""}, ["check", "p"], "is a pipe: a regular file is needed"),
    "a pipe as traffic": (
        {"|p.daa": ""}, ["check", "REPLAY", "--set", "blocks.traffic.file=p.daa"], "is a pipe",
    ),
    "a folder as table": (
        {}, set_("blocks.traffic.intruders[0].rcs_table", "/"), "is a folder",
    ),
    "UTF-16": ({"a.toml": "title = 'x'".encode("utf-16")}, ["check", "a.toml"], "in UTF-8"),
    "NUL bytes": ({"a.toml": b"title = 'a\0'"}, ["check", "a.toml"], "holds NUL characters"),
    "unknown home": (
        {}, ["check", "REPLAY", "--set", "blocks.traffic.file=~nosuchuser/x.daa"], "no home folder",
    ),
    "service spread": (
        {},
        set_("processors.cpu.service_spread_s", "1e308", "--set", "processors.cpu.service_s=1"),
        "service_spread_s = 1e+308",
    ),
    "service beyond all ticks": (
        {},
        set_("processors.cpu.service_spread_s", "1e40", "--set", "processors.cpu.service_s=1"),
        "how far this scene's ticks reach",
    ),
    "sample interval": ({}, [*RUN, "--set", "blocks.traffic.sample_interval_s=1e-320"], "0.001"),
    "sample interval 2": ({}, [*RUN, "--set", "blocks.traffic.sample_interval_s=1e-12"], "0.001"),
    "delay in scans": (
        {}, [*RUN, "--set", 'wires[1].delay="10000000000000000000 scans"'], "at most 1,000,000",
    ),
    "scans beyond all ticks": (
        {},
        [*RUN, "--set", 'wires[4].delay="1000000 scans"',
         "--set", "blocks.radar.scan_rate_hz=1e-5"],
        "scans take longer than this scene's ticks reach",
    ),
    "a gate beyond all ticks": (
        {}, [*RUN, "--set", "blocks.fusion.coincidence_s=1e30"], "how far this scene's ticks reach",
    ),
    "rcs": ({}, [*RUN, "--set", "blocks.traffic.intruders[0].rcs_dbsm=1e200"], "to 300 in size"),
    "subnormal": ({}, [*RUN, "--set", "blocks.radar.range_km=5e-324"], "from 1e-30"),
    "endless work": (
        {}, ["check", SCENE, "--duration", "1e6", "--set", "blocks.radar.scan_rate_hz=1e9"],
        "scans: at most 1e+12",
    ),
    "csv field": (
        {"t.csv": "az_deg,el_deg,dbsm\n0,0," + "x" * 140000},
        set_("blocks.traffic.intruders[0].rcs_table", "t.csv"),
        "line 2: cannot be read: field larger than field limit",
    ),
    "a table of no physics": (
        {"t.csv": "az_deg,el_deg,dbsm\n0,0,1e300\n"},
        set_("blocks.traffic.intruders[0].rcs_table", "t.csv"),
        "line 2: dbsm is 1e+300: must be 0, or from 1e-30 to 300 in size",
    ),
    "a time of 1e9 s": (
        {"t.daa": "NAME lat lon alt time\n[none] [deg] [deg] [ft] [s]\n"
         "A 0 0 900 0\nB 0 0.1 900 0\nA 0 0 900 1\nB 0 0.1 900 1e9\n"},
        ["run", "REPLAY", "--quiet", "--out", "o", "--set", "blocks.traffic.file=t.daa"],
        "line 6, column time: the time is 1000000000 s, and the one before it, in line 5, is 1 s",
    ),
    "pace of a snail": ({}, [*RUN, "--realtime", "1e-300"], "from 1e-06"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_refused(name, tmp_path, monkeypatch, configs):
    files, argv, text = CASES[name]
    for path, content in files.items():
        place = tmp_path / path.lstrip("@|")
        if path.startswith("@"):
            place.symlink_to(content)
        elif path.startswith("|"):
            os.mkfifo(place)
        else:
            place.write_bytes(content if isinstance(content, bytes) else content.encode())
    before = {path.name for path in tmp_path.iterdir()}
    monkeypatch.chdir(tmp_path)
    named = {SCENE: configs / "first_light.toml", "REPLAY": configs / "replay_daa.toml"}
    result = CliRunner().invoke(main, [str(named.get(word, word)) for word in argv])
    assert result.exit_code == 2, result.output[-300:]
    assert isinstance(result.exception, SystemExit)
    assert "error: " in result.output.lower() and text.lower() in result.output.lower()
    assert len(result.output) < 30_000
    assert {path.name for path in tmp_path.iterdir()} == before


def test_thousands_of_problems_are_twenty_and_a_count(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("".join(f'[blocks.b{i}]\ntype = "gatee"\n' for i in range(3000)))
    output = CliRunner().invoke(main, ["check", str(path)]).output
    assert output.count("unknown block type; did you mean 'gate'?") == 20
    assert output.splitlines()[0] == "error: 3000 problems:"
    assert output.splitlines()[-1] == "  and 2980 more"


def test_long_values_and_keys_are_shown_by_their_beginning(tmp_path):
    path = tmp_path / "a.toml"
    numbers = ", ".join(["1"] * 50_000)
    path.write_text(f'"{"k" * 100_000}" = 1\ntitle = [{numbers}]\nblocks = "{"v" * 100_000}"\n')
    output = CliRunner().invoke(main, ["check", str(path)]).output
    assert "title = [1, 1, 1" in output and "kkk…: unknown key" in output
    assert len(output) < 2000


def test_a_byte_order_mark_is_no_fault(tmp_path, configs):
    path = tmp_path / "a.toml"
    text = f'extends = "{configs / "first_light.toml"}"\r\nduration_s = 1\r\n'
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    result = CliRunner().invoke(main, ["check", str(path)])
    assert result.exit_code == 0, result.output


def test_a_long_run_is_said_to_be_long(configs):
    scene = str(configs / "first_light.toml")
    result = CliRunner().invoke(main, ["check", scene, "--duration", "1e8"])
    assert result.exit_code == 0
    assert "note: 1e+08 s of this scene are about 2.7e+09 scans" in result.output
