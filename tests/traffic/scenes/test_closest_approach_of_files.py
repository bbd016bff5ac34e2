"""A file's closest approach is that of the flights, however far apart its samples are."""

import math

import pytest
from wired import chain, run, sensor

#: Along the equator longitude is length: metres a degree at 1,000 m.
DEGREE_M = math.radians(1.0) * (6_378_137.0 + 1000.0)
OWN_MPS, OTHER_MPS = 120.0, 130.0


def told(tmp_path, other, times=(0, 60, 120), duration_s=120):
    """Closest approach to one aircraft, whose (lat, lon, alt) at a time `other` gives."""
    lines = ["time,id,lat,lon,alt"]
    lines += [f"{t},OWN,0,{OWN_MPS * t / DEGREE_M!r},1000" for t in times]
    lines += [f"{t},X,{','.join(map(repr, other(t)))}" for t in times]
    path = tmp_path / "two.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    scene = chain({"radar": sensor("radar.range_boundary")}, duration_s=duration_s)
    scene["blocks"]["traffic"] = {"type": "traffic.csv", "file": str(path)}
    return run(scene).info["summary"]["targets"]["X"]["closest_approach"]


@pytest.mark.parametrize("miss_m", [0.0, 40.0, 900.0])
def test_it_lies_between_the_samples(tmp_path, miss_m):
    """Head-on at 250 m/s, met at 31.037 s: on a grid of 0.1 s up to 9 m off, at samples 7 km."""
    met_deg = OWN_MPS * 31.037 / DEGREE_M

    def other(t):
        return 0.0, met_deg - OTHER_MPS * (t - 31.037) / DEGREE_M, 1000.0 + miss_m

    found = told(tmp_path, other)
    assert found["range_m"] == pytest.approx(miss_m, abs=0.05)
    assert found["time_s"] == pytest.approx(31.037, abs=0.002)
    assert "at" not in found
    # A run that ends between two samples looks up to its end.
    cut = told(tmp_path, other, duration_s=30)
    assert cut["time_s"] == 30.0 and cut["at"] == "the end of the run"
    closing_m = 1.037 * (OWN_MPS + OTHER_MPS)
    assert cut["range_m"] == pytest.approx(math.hypot(closing_m, miss_m), rel=1e-3)


def test_one_in_formation_is_closest_at_the_start(tmp_path):
    def beside(t):
        return 0.003, OWN_MPS * t / DEGREE_M, 1000.0

    found = told(tmp_path, beside)
    assert found["time_s"] == 0.0 and found["at"] == "the start"
    assert found["range_m"] == pytest.approx(331.8, abs=0.2)
