"""The head of docs/accuracy-and-cost.md speaks of one scene, and of where its first look ends."""

import math
import re

import numpy as np
import pytest

from docs.make.accuracy_and_cost.__main__ import DOCS, PIXEL_DEG, cut_off, radar_sees_from
from dsa_des.scene.scene import load_scene

PAGE = (DOCS / "accuracy-and-cost.md").read_text(encoding="utf-8")
HEAD = {line.split("**")[1]: line for line in PAGE.splitlines() if re.match(r"\d\. \*\*", line)}
FLOWN = PAGE[PAGE.index("## A flown encounter") :]
CONFIGS = DOCS.parent / "configs"


def rows() -> dict[tuple[str, str], list[str]]:
    """The tables of the encounter: (block, rung) → the cells behind the rung's name."""
    found, block = {}, ""
    for line in FLOWN.splitlines():
        title = re.match(r"\*\*(\w+), \w+\*\*:", line)
        block = title[1] if title else block
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and cells[0] != "rung":
            found[block, cells[0].replace("**", "").replace(" (scene)", "")] = cells[1:]
    return found


def us(block: str, rung: str) -> float:
    return float(rows()[block, rung][0].split()[0])


def moved_km(block: str, rung: str) -> float:
    return float(rows()[block, rung][4].replace(",", "")) / 1000.0


def numbers(topic: str) -> list[float]:
    text = HEAD[topic].partition("**: ")[2].replace("0.1 s", "").replace("95th", "")
    return [float(text) for text in re.findall(r"(?<![\w.])\d+\.?\d*", text)]


def test_all_numbers_are_of_the_flown_encounter() -> None:
    """Shown cells have two or three digits, so differences of them are right to a unit more."""
    flat, turned = rows()["transform", "flat_earth"], rows()["transform", "small_angle"]
    assert numbers("Geometry") == [
        pytest.approx(us("transform", "ellipsoid") - us("transform", "flat_earth"), abs=0.011),
        pytest.approx(float(flat[3]), rel=0.05),
        pytest.approx(float(flat[3]) / math.radians(PIXEL_DEG) / 1e3, rel=0.05),
        pytest.approx(us("transform", "exact") - us("transform", "small_angle"), abs=0.011),
        pytest.approx(float(turned[3]), rel=0.02),
    ]
    exact = us("radar", "exact")
    said, table = numbers("Radar"), us("radar", "table") / exact
    if "the table costs as much" in HEAD["Radar"]:
        assert table == pytest.approx(1.0, rel=0.11)
    else:  # by which machine and hour made the page
        assert said.pop(0) == pytest.approx(table, rel=0.06)
    assert said == [
        pytest.approx(us("radar", "gram_charlier") / exact, rel=0.06),
        pytest.approx(exact - us("radar", "range_boundary"), abs=0.011),
        pytest.approx(-moved_km("radar", "threshold"), abs=0.051),
        pytest.approx(-moved_km("radar", "range_boundary"), abs=0.051),
        pytest.approx(8.9, abs=0.0),  # where NRC intercept 23 begins: 8.874 km
    ]
    eo_moved_km = [moved_km("eo", rung) for rung in ("exact", "range_boundary", "projection")]
    assert numbers("Camera") == [
        pytest.approx(us("eo", "union"), abs=0.006),
        pytest.approx(us("eo", "exact"), abs=0.006),
        *(pytest.approx(abs(moved), abs=0.051) for moved in eo_moved_km),
        pytest.approx(us("eo", "mesh") / us("eo", "union"), rel=0.01),
    ]
    said_when = re.findall(r"too (early|late)", HEAD["Camera"])
    assert said_when == ["early" if moved > 0.0 else "late" for moved in eo_moved_km]
    window = rows()["fusion", "window"]
    share = float(window[8].rstrip("%"))
    before = float(rows()["transform", "small_angle"][8].rstrip("%"))
    assert numbers("Fusion") == [
        pytest.approx(us("fusion", "window") - us("fusion", "exact_instant"), abs=0.011),
        pytest.approx(before, abs=0.51),
        pytest.approx(share, abs=0.51),
        pytest.approx(float(window[2]) - float(rows()["fusion", "exact_instant"][2]), abs=0.51),
    ]


def test_a_first_detection_at_the_start_or_at_the_edge_is_said_to_be_cut_off() -> None:
    scans = np.arange(0.0, 10.0, 0.2)
    assert "where the scene begins, at 8.9 km" in cut_off(0.2, 8874.0, scans, 15e3)
    assert "edge of its reach, 15 km" in cut_off(30.0, 14_900.0, scans, 15e3)
    assert cut_off(30.0, 9_000.0, scans, 15e3) == ""


def test_the_radar_of_a_scene_sees_from_its_start_or_from_its_edge() -> None:
    first = CONFIGS / "first_light.toml"
    assert "begins, at 12.0 km" in radar_sees_from(load_scene(first))
    # Both come from beyond 15 km: the exact radar sees them as soon as it looks that far.
    far = [f"blocks.traffic.intruders.{name}.north_m=17000" for name in ("head_on", "crossing")]
    assert "edge of its reach, 15 km" in radar_sees_from(load_scene(first, sets=far))
