"""A sensor that is switched off keeps no target from being left out, however far it looks."""

import crooked
import pytest
from wired import chain, rows, run, sensor


@pytest.mark.parametrize(("enabled", "culled"), [(False, 1), (True, 0)])
def test_targets_beyond_all_that_are_on_are_not_moved(enabled, culled):
    far = {**crooked.DIVING, "name": "far", "north_m": -60_000.0}
    sensors = {
        "near": sensor("radar.range_boundary", range_km=5.0),
        "long": sensor("radar.range_boundary", range_km=100.0, enabled=enabled),
    }
    found = rows(run(chain(sensors, targets=[crooked.ROLLING, far])), "scans", block="near")
    assert [row["skipped_culled"] for row in found] == [culled]
    assert [row["skipped_range"] for row in found] == [1 - culled]
