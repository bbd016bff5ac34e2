"""The chain as a simulator of mosaik: its scans at mosaik's steps, or a refusal."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_without_the_extra_one_line_names_the_command():
    code = "import sys; sys.modules['mosaik_api_v3'] = None\n"
    code += "import components.foreign.mosaik_simulator"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert "pip install 'dsa-des[mosaik]'" in done.stderr.splitlines()[-1]


def test_the_scenario_of_the_page(tmp_path):
    pytest.importorskip("mosaik")
    page = (ROOT / "docs" / "foreign.md").read_text(encoding="utf-8")
    (text,) = (t for t in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "mosaik" in t)
    file = tmp_path / "scenario.py"
    file.write_text(text.replace("0.05, 60", "0.05, 50"))
    done = subprocess.run(
        [sys.executable, str(file)], capture_output=True, text=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = re.fullmatch(r"(\d+) detections, equal to the bit", done.stdout.splitlines()[-1])
    assert found is not None and int(found[1]) > 100


@pytest.fixture
def chain():
    pytest.importorskip("mosaik_api_v3")
    from components.foreign.mosaik_simulator import ChainOfMosaik

    return ChainOfMosaik()


@pytest.mark.parametrize(
    ("resolution", "sets", "said"),
    [
        (1.0, (), "scans fall between mosaik's steps: blocks.eo scans every 1/20 s from 1/20 s on"),
        (0.1, (), "blocks.eo scans every 1/20 s"),
        (1e-11, (), "a step is 0.01 ticks of the scene"),
        (0.05, ("blocks.radar.scan_rate_hz=3",), "blocks.radar scans every 1/3 s"),
        (
            0.05,
            ("blocks.radar.jitter_s=0.001",),
            "blocks.radar scans every 1/5 s from 0 s on, with",
        ),
    ],
)
def test_time_that_does_not_meet_is_refused(chain, resolution, sets, said):
    scene = str(ROOT / "configs" / "first_light.toml")
    with pytest.raises(ValueError, match=re.escape(said)):
        chain.init("chain", resolution, scene=scene, sets=sets)


def test_steps_are_those_of_the_scans(chain):
    chain.init("chain", 0.01, scene=str(ROOT / "configs" / "first_light.toml"))
    chain.create(1, "Ownship")
    chain.create(1, "Plane", name="near")
    chain.setup_done()
    place = {"lat_deg": {"a": 52.0}, "lon_deg": {"a": 4.4}, "alt_m": {"a": 900.0}}
    near = {**place, "lat_deg": {"a": 52.02}}
    steps, time = [], 0
    while time < 30:
        time = chain.step(time, {"Ownship": place, "near": near}, 100)
        steps.append(time)
    assert steps == [5, 10, 15, 20, 25, 30]
    found = chain.get_data({"near": ["range_m", "sensors"], "Ownship": ["detections"]})
    assert found["near"]["sensors"] and {row[1] for row in found["Ownship"]["detections"]} == {
        "near"
    }
    assert (
        2150 < found["near"]["range_m"] < 2300
        or found["near"]["range_m"] != found["near"]["range_m"]
    )
    with pytest.raises(ValueError, match="has 2 sources"):
        chain.step(30, {"Ownship": {**place, "alt_m": {"a": 1.0, "b": 2.0}}}, 100)
