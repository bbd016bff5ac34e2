"""What comes while a processor that skips is busy is never put together."""

import pytest
from same_runs import tables_of

import dsa_des

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 50}
OTHERS = [{"name": f"i{k}", "east_m": 400 * k, "north_m": 3000, "up_m": 0, "heading_deg": 180,
           "speed_mps": 50} for k in range(2)]  # fmt: skip


@pytest.mark.parametrize("fusion", ["pick_best", "gated", "pass_through"])
def test_a_fusion_leaves_out_what_came_while_it_was_busy(fusion):
    """Scans every 0.25 s and 0.6 s of work: the fusion takes each third scan alone."""
    radar = {"type": "radar.range_boundary", "scan_rate_hz": 4, "range_km": 9}
    scene = dsa_des.load_scene({
        "title": "t", "duration_s": 3,
        "wires": ["traffic -> transform -> gate -> radar -> fusion"],
        "processors": {"cpu": {"service_s": 0.6, "when_busy": "skip"}},
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": OWN, "intruders": OTHERS},
            "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"}, "radar": radar,
            "fusion": {"type": f"fusion.{fusion}", "processor": "cpu"},
        },
    })  # fmt: skip
    fused = tables_of(scene)[1]["fused"].to_pylist()
    rows = [(row["time_s"], row["target"]) for row in fused]
    assert sorted(rows) == [(0.75 * k, f"i{n}") for k in range(4) for n in range(2)]
