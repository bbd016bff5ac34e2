"""The chain of a scene as an FMU, run by FMPy and by our own block."""

import sys

import pytest

from components.foreign.fmu.export import write_chain_fmu
from dsa_des.errors import SceneError

pytest.importorskip("pythonfmu3", reason="needs pythonfmu3: pip install 'dsa-des[fmu]'")
pytest.importorskip("fmpy", reason="needs FMPy: pip install 'dsa-des[fmi]'")
_POSES = ("lat_rad", "lon_rad", "alt_m", "yaw_rad", "pitch_rad", "roll_rad")


@pytest.fixture
def chain(lab, capsys):
    """The chain of first light."""
    if sys.platform != "linux":
        pytest.skip("needs Linux")
    path = lab.folder / "chain.fmu"
    write_chain_fmu(str(lab.configs / "first_light.toml"), str(path))
    return path


def _inputs():
    columns = [name.replace("t_rad", "t_deg").replace("n_rad", "n_deg") for name in _POSES]
    lines = [f'own_{name} = "traffic.own_{c}"' for name, c in zip(_POSES, columns, strict=True)]
    for number, target in ((1, "head_on"), (2, "crossing")):
        for name, column in zip((*_POSES, "present"), (*columns, "present"), strict=True):
            lines.append(f'"plane[{number}].{name}" = "traffic.{column}[{target}]"')
    return "\n".join(lines)


def test_the_chain_in_the_chain_detects_the_same(lab, chain):
    scene = lab.folder / "scene.toml"
    wires = ["traffic -> transform -> gate", "gate -> radar", "gate -> eo", "gate -> ir",
             "radar -> fusion", "eo -> fusion", "ir -> fusion", "traffic -> chain"]  # fmt: skip
    tables = ('[blocks.tracker]\ntype = "tracking.stub"\n', "fusion -> tracker")
    scene.write_text(
        f'extends = "{lab.configs / "first_light.toml"}"\nduration_s = 8\n'
        f"wires = {[*wires, tables[1]]}\n[blocks.chain]\n"
        f'type = "foreign.fmu"\nfile = "{chain}"\nscan_rate_hz = 20\n'
        f"[blocks.chain.inputs]\n{_inputs()}\n",
        encoding="utf-8",
    )
    tables = lab.run(scene).tables
    said = {}
    for row in tables["signals"].to_pylist():
        said.setdefault(row["tick"], {})[row["signal"]] = row["value"]
    inside = {
        (round(s["time_s"], 6), name): (
            s[f"plane[{i}].azimuth_rad"], s[f"plane[{i}].elevation_rad"], s[f"plane[{i}].range_m"]
        )
        for tick, s in said.items() if tick
        for i, name in ((1, "head_on"), (2, "crossing")) if s[f"plane[{i}].detected"]
    }  # fmt: skip
    outside = {
        (round(r["time_s"], 6), r["target"]): (
            r["azimuth_rad"], r["elevation_rad"], -1.0 if r["range_m"] is None else r["range_m"]
        )
        for r in tables["fused"].to_pylist() if r["time_s"] < max(said) / 1e9 - 0.01
    }  # fmt: skip
    assert len(outside) > 20
    assert inside == outside


def test_fmpy_runs_it(chain):
    import subprocess

    # FMPy loads it into its own process, which is not to be ours.
    program = (
        "import fmpy, sys; r = fmpy.simulate_fmu(sys.argv[1], stop_time=1.0, "
        "step_size=0.1, output_interval=0.1, "
        "start_values={'own_alt_m': 1000.0, 'plane[1].lat_rad': 0.0003, 'plane[1].alt_m': 1000.0, "
        "'plane[2].present': False}); print(bool(r['plane[1].detected'].any()), "
        "bool(r['plane[2].detected'].any()), r['time_s'][-1])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(chain)], capture_output=True, text=True, check=True
    )
    detected, other, time_s = done.stdout.split()[-3:]
    assert (detected, other) == ("True", "False")
    assert float(time_s) == pytest.approx(0.9)


def test_a_scene_that_no_host_can_drive_is_refused_and_nothing_is_written(lab):
    out = lab.folder / "x.fmu"
    with pytest.raises(SceneError, match="feedback"):
        write_chain_fmu(str(lab.configs / "avoidance" / "crossing.toml"), str(out))
    assert list(lab.folder.iterdir()) == []
