"""The published campaign: counts of several folders, and whose interval holds whose."""

import numpy as np
import pytest
from click.testing import CliRunner

from docs.make.platforms.campaign import counted, rows
from dsa_des.cli import main

pd = pytest.importorskip("pandas")


def test_runs_of_a_cell_count_together_and_are_held_against_the_published_ones():
    many = {"crossing_deg": 90, "error_m": 30, "well_clear_lost_mitigated": [1.0] * 3 + [0.0] * 997}
    first = pd.DataFrame(many)
    more = pd.DataFrame(many | {"well_clear_lost_mitigated": [1.0] + [0.0] * 999})
    rings = {"aircraft": 8, "error_m": 5, "well_clear_lost_mitigated": [1.0] * 50 + [0.0] * 50}
    fours = pd.DataFrame(rings | {"aircraft": 4, "error_m": 30})
    sixes = {"aircraft": 6, "error_m": 30, "well_clear_lost_mitigated": [1.0] * 64 + [0.0] * 4436}
    studies = [first, more, pd.DataFrame(rings), fours, pd.DataFrame(sixes)]
    of_rings = {("ring of 8", 5): (50, 100), ("ring of 4", 30): (50, 100)}
    of_rings |= {("ring of 6", 30): (64, 4500)}
    assert counted(studies) == {("pair, 90°", 30): (4, 2000)} | of_rings
    name, split = "well_clear_lost_mitigated", {"crossing_deg": 180, "error_m": 10}
    split |= {name: [2e-5, 4e-5], f"{name}.runs": 500.0, f"{name}.unseen": 0.0}
    studies.append(pd.DataFrame(split | {f"{name}.collapsed": 0.0}))
    pair, four, six, ring, of_repetitions = rows(studies)[2:]
    assert four.endswith("| 3.97e-3 (3.32e-3 to 4.74e-3) loop | no |")
    assert six.endswith("| 1.42e-2 (1.12e-2 to 1.81e-2) | 1.18e-2 (1.06e-2 to 1.32e-2) loop | no |")
    assert of_repetitions.startswith(
        "| pair, 180° | 10 | split, 0 of 2 collapsed | 1,000 | 3.00e-5 ("
    )
    # Wilson's interval of 4 of 2,000 holds 61 of 54,900, whose own ends at 1.43e-3.
    assert pair == (
        "| pair, 90° | 30 | 4 | 2,000 | 2.00e-3 (7.78e-4 to 5.13e-3) | "
        "1.11e-3 (8.65e-4 to 1.43e-3) | under 50 lost |"
    )
    assert ring.endswith("| no |") and "5.00e-1" in ring


def test_pairs_of_the_shipped_study_meet_where_both_fly_on_and_all_cells_of_all_run(tmp_path):
    within = "metrics=[{metric='mitigated', horizontal_m=%s, vertical_m=50, nmac_horizontal_m=0.5}]"
    for study, keys in {
        "velocity_pairs": ("set.duration_s=78", within % 1),
        "velocity_rings": ("set.duration_s=2",),
        "fleet_size": ("set.duration_s=2",),
    }.items():
        sets = [word for key in ("replicas=1", *keys) for word in ("--set", key)]
        end = ("--workers", "1", "--quiet", "--no-figures", "--out", str(tmp_path / study))
        done = CliRunner().invoke(main, ["study", study, *sets, *end])
        assert done.exit_code == 0, done.output
        runs = pd.read_parquet(tmp_path / study / "parts")
        if study == "fleet_size":
            # Who is on the circle has neighbours a chord away, two seconds nearer to the middle.
            chord = 2.0 * np.sin(np.pi / runs["aircraft"])
            assert runs["least_separation_m"].between(1400 * chord, 1500.01 * chord).all()
            assert sorted(runs["aircraft"]) == [2, 4, 8, 16]
            continue
        assert len(counted([runs])) == 12
        if study == "velocity_pairs":
            assert (runs["well_clear_lost_nominal"] == 1.0).all()
