"""What straight rays get wrong where a scene bends them: D cos(elevation) / (8 R)."""

import numpy as np
import pymap3d
import pytest

import dsa_des
from components.line_of_sight.transform import EARTH, REFRACTION
from dsa_des.commands.cost import comparison_of_all_reports
from dsa_des.costs.climb import inapplicable_reason, measure_rungs
from dsa_des.costs.variants import Variants


@pytest.fixture
def scene(configs, tmp_path):
    def write(terrain):
        path = tmp_path / "scene.toml"
        base = (configs / "first_light.toml").as_posix()
        path.write_text(f'extends = "{base}"\nduration_s = 2\n{terrain}', encoding="utf-8")
        return Variants(str(path))

    return write


def test_straight_rays_err_by_the_bending(scene):
    variants = scene('[terrain]\nrefraction = "four_thirds"\n')
    straight, bent = measure_rungs(
        variants, "transform", REFRACTION, repeats=1, compare=comparison_of_all_reports()
    )
    assert (straight.in_scene, bent.in_scene) == (False, True)
    # The farthest is level, some 11 km away.
    expected = [1e3 * range_m * np.cos(elevation) / (8 * 6371008.8)
                for range_m, elevation in _looks(variants)]  # fmt: skip
    assert max(expected) > 0.1
    assert straight.first_quantity_error.maximum == pytest.approx(max(expected), rel=1e-3)
    assert inapplicable_reason(variants, "transform", REFRACTION) == ""


def test_it_is_left_out_where_rays_are_straight_and_the_earth_s_error_is_its_own(scene):
    variants = scene("")
    assert "rays are straight" in inapplicable_reason(variants, "transform", REFRACTION)
    bent = scene('[terrain]\nrefraction = "four_thirds"\n')
    exact = measure_rungs(bent, "transform", EARTH, repeats=1, compare=comparison_of_all_reports())[
        -1
    ]
    assert exact.error_note == "nothing more exact is known of bent rays"


def _looks(variants):
    """Every line of sight of the run, straight, from the recorded truth by pymap3d."""
    rows = dsa_des.run(variants.scene)["truth"].to_pylist()
    own = {row["tick"]: row for row in rows if row["target"] is None}
    found = []
    for row in rows:
        if row["target"] is None:
            continue
        at, here = ([r["lat_deg"], r["lon_deg"], r["alt_m"]] for r in (row, own[row["tick"]]))
        _, elevation, range_m = pymap3d.geodetic2aer(*at, *here)
        found.append((float(range_m), np.radians(elevation)))
    return found
