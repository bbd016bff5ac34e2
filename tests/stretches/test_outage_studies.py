"""The shipped studies of a radar's outages, in short form, and the tables made of them."""

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import dsa_des
from docs.make.outages.__main__ import link_rows, moment_rows, risk_rows
from dsa_des.cli import main
from dsa_des.files.toml_files import to_toml
from dsa_des.replicas.outage_times import outage_times_of_seeds


def runs_of(folder, *words, replicas):
    few = ["--set", f"replicas={replicas}", "--workers", "1", "--quiet", "--no-figures"]
    done = CliRunner().invoke(main, ["study", *words, *few, "--out", str(folder)])
    assert done.exit_code == 0, done.output
    runs = pd.read_parquet(folder / "parts")
    assert (runs.status == "done").all()
    return runs


def test_a_radar_that_fails_leaves_more_of_the_risk_on_the_same_draws(tmp_path):
    runs = runs_of(tmp_path / "all", "radar_outage_risk", replicas=24)
    by = runs.set_index(["outage", "replica"])
    never, worst = by.loc["never"], by.loc["30 s, 60 s"]
    assert (never["out_share.radar"] == 0).all() and (worst["out_share.radar"] > 0).any()
    nominal = [name for name in runs if name.endswith("_nominal")]
    assert all(by.loc[outage][nominal].equals(never[nominal]) for outage in runs.outage.unique())
    # An encounter in which nothing fails is flown as without outages, to the bit.
    flown = [name for name in runs if "alert" in name or "mitigated" in name]
    for outage in runs.outage.unique():
        fine = by.loc[outage]["out_share.radar"] == 0
        assert by.loc[outage][flown][fine].equals(never[flown][fine])
    # A mean time is a scale: what fails after 600 s fails five times as often after 120 s.
    shares = by["out_share.radar"].groupby("outage", sort=False).mean()
    assert shares.is_monotonic_increasing
    # Without the table, the scene is the one that never fails.
    scene = dsa_des.load_scene("radar_fails").resolved()
    del scene["outages"]
    (tmp_path / "fine.toml").write_text(to_toml(scene))
    tables = {
        "scene": "fine.toml", "seed": 1, "draws": {"blocks": {"traffic": {"encounter":
        {"sequence": [0, 1]}}}}, "metrics": [{"metric": "alert_times", "horizontal_m": 670.56,
                                              "vertical_m": 137.16}],
    }  # fmt: skip
    (tmp_path / "study.toml").write_text(to_toml(tables))
    alone = runs_of(tmp_path / "fine", str(tmp_path / "study.toml"), replicas=24)
    lead = "alert_to_loss_s.alerting"
    assert np.array_equal(alone[lead], never[lead], equal_nan=True)
    missed = "alert_missed.alerting"
    last = risk_rows(tmp_path / "all")[-1].split(" | ")
    because = (worst[missed] > 0) & (never[missed] == 0)
    assert last[-3] == f"{int(worst[missed].sum())} of 24" and last[-2] == str(because.sum())
    assert because.sum() > 0


def test_an_alert_loses_most_if_the_radar_fails_just_before_it(tmp_path):
    runs = runs_of(tmp_path, "radar_outage_moment", replicas=2)
    by = runs.groupby("fails_at_s")[["first_alert_time_s.alerting", "alert_to_loss_s.alerting"]]
    first_s, lead_s = (of.to_dict() for _, of in by.mean().items())
    fine_s = first_s[60]
    for fails_s, alert_s in first_s.items():
        # The alert keeps its time if it has come, or its track coasts to it; else it waits for the
        # radar to be back for twenty seconds, and for a new track.
        waits = fails_s + 20 <= alert_s <= fails_s + 20 + 4
        assert waits if fails_s <= 20 else alert_s == pytest.approx(fine_s, abs=1)
        assert lead_s[fails_s] + alert_s == pytest.approx(lead_s[60] + fine_s)
    cells = [line.strip("| ").split(" | ") for line in moment_rows(tmp_path)[2:]]
    lost_s = {float(cell[0]): float(cell[2]) for cell in cells}
    assert max(lost_s, key=lost_s.__getitem__) == 20
    assert lost_s[20] == pytest.approx(first_s[20] - fine_s, abs=0.06)


def test_a_link_that_fails_leaves_more_of_the_risk_and_fine_runs_as_they_were(tmp_path):
    runs = runs_of(tmp_path, "link_outage_risk", replicas=12)
    by = runs.set_index(["outage", "replica"])
    never = by.loc["never"]
    flown = [name for name in runs if name.endswith(("_nominal", "_mitigated"))]
    scene = dsa_des.load_scene("link_fails")
    same = changed = 0
    for outage, mean_s, repair_s in (("120 s, 60 s", 120, 60), ("30 s, 60 s", 30, 60)):
        mine = by.loc[outage]
        assert (mine.seed == never.seed).all()
        one = dsa_des.load_scene("link_fails", sets=[
            f"outages[0].mean_between_s={mean_s}", f"outages[0].mean_repair_s={repair_s}"
        ])  # fmt: skip
        out = outage_times_of_seeds(one, mine.seed.tolist(), np.full(len(mine), 180.0))["pilot"]
        for number, spans in enumerate(out):
            alike = mine[flown].iloc[number].equals(never[flown].iloc[number])
            assert len(spans) or alike
            same += not len(spans)
            changed += not alike
    assert same and changed and [o.key for o in scene.outages] == ["link"]
    assert link_rows(tmp_path)[2].startswith("| never | ")
