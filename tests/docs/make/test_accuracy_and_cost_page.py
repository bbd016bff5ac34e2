"""docs/accuracy-and-cost.md holds what is computed: its errors, which no machine changes."""

import math
import re

import pytest

from components.line_of_sight.transform import EARTH
from components.optical.sensors import VISIBLE
from docs.make.accuracy_and_cost.__main__ import DOCS, error_map_section, main
from dsa_des.commands.cost import comparison_of_all_reports
from dsa_des.costs.climb import measure_rungs
from dsa_des.costs.variants import Variants

PAGE = (DOCS / "accuracy-and-cost.md").read_text(encoding="utf-8")


def test_the_first_five_lines_answer():
    part = PAGE[PAGE.index("## Models of one scene") :]
    lines = [line for line in part.splitlines() if line][1:6]
    for word, line in zip(("35 GHz", "Geometry", "Radar", "Camera", "Fusion"), lines, strict=True):
        assert word in line


def test_its_figures_are_there():
    for name in re.findall(r"\]\((images/[^)]+)\)", PAGE):
        assert (DOCS / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("block", "ladder", "skip"), [("transform", EARTH, {"ellipsoid"}), ("eo", VISIBLE, {"union"})]
)
def test_errors_and_effects_are_those_that_are_computed(block, ladder, skip):
    quick = {rung.name for rung in ladder.rungs} - {"mesh", "geodesic", "aspect_table", "image"}
    small = type(ladder)(**{**vars(ladder), "rungs": tuple(
        rung for rung in ladder.rungs if rung.name in quick)})  # fmt: skip
    variants = Variants(str(DOCS.parent / "configs" / "first_light.toml"))
    scene = PAGE[PAGE.index("## The thesis's scene") : PAGE.index("## A flown encounter")]
    for cost in measure_rungs(
        variants, block, small, repeats=1, compare=comparison_of_all_reports()
    ):
        if cost.rung in skip:
            continue
        row = next(
            line.replace("**", "").replace(" (scene)", "")
            for line in scene[scene.index(f"**{block}, {ladder.name}**") :].splitlines()
            if line.replace("**", "").startswith(f"| {cost.rung} ")
        )
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        for text, value in zip(
            cells[2:5],
            (
                cost.first_quantity_error.mean,
                cost.first_quantity_error.p95,
                cost.first_quantity_error.maximum,
            ),
            strict=True,
        ):
            assert float(text) == pytest.approx(value, rel=0.06)
        assert int(cells[7]) == cost.effect["detections_gained"]
        assert int(cells[8]) == cost.effect["detections_lost"]


def test_it_refuses_what_it_cannot_read(tmp_path):
    with pytest.raises(SystemExit):
        main(["--encounters", str(tmp_path)])


def test_the_section_of_the_error_map_is_the_one_that_is_computed(tmp_path):
    section = error_map_section(tmp_path)
    assert section in PAGE
    assert (tmp_path / "error_map_angle.png").read_bytes().startswith(b"\x89PNG")
    rows = {
        tuple(cells[:2]): cells[2:]
        for line in section.splitlines()
        if len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 6
    }
    # Half the angle of the Earth at 6.6 km is 0.03 deg; flat Earth is off by more from the start.
    assert float(rows["geodesic", "0.03°"][0]) == pytest.approx(
        2 * math.radians(0.03) * 6371, rel=0.02
    )
    assert rows["flat_earth", "0.03°"][:3] == ["none"] * 3
