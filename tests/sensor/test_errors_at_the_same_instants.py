"""An error that lasts is one of its instant, whatever the scan rate."""

import numpy as np
from same_runs import tables_of

from dsa_des.library.scenes import load_scene

ERRS = [
    "blocks.eo.errors=stated", "blocks.eo.azimuth_error_deg=0.3",
    "blocks.eo.azimuth_correlation_time_s=2", "blocks.eo.quantised=false",
    "blocks.eo.noise_equivalent_contrast=0",
]  # fmt: skip


def test_scan_rates_share_what_lasts():
    """Twice as many scans: at the instants that both have, an error that lasts is the same."""
    found = []
    for rate in (2, 4):
        sets = [*ERRS, f"blocks.eo.scan_rate_hz={rate}"]
        seen = load_scene("configs/first_light.toml", sets=sets, duration_s="100")
        table = tables_of(seen)[1]["detections"]
        column = {n: table[n].to_numpy(zero_copy_only=False) for n in table.column_names}
        mine = (column["block"] == "eo") & (column["target"] == "head_on")
        off = column["azimuth_rad"][mine] - column["true_azimuth_rad"][mine]
        found.append(dict(zip(column["tick"][mine].tolist(), off.tolist(), strict=True)))
    slow, fast = found
    common = sorted(slow.keys() & fast.keys())
    assert len(common) == len(slow) > 10
    np.testing.assert_array_equal([slow[t] for t in common], [fast[t] for t in common])
