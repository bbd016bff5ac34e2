"""The shipped study of who avoids: the same encounters for all, and the same as without a chain."""

import pandas as pd
import pytest
from click.testing import CliRunner

import dsa_des
from components.examples import configs_folder as examples
from docs.make.platforms.equipage import rows
from dsa_des.cli import main
from dsa_des.files.toml_files import to_toml

FEW = ("--set", "replicas=60", "--set", "runs_per_chunk=60", "--workers", "1", "--quiet")
FLAGS = ["nmac_nominal", "nmac_mitigated", "well_clear_lost_nominal", "well_clear_lost_mitigated"]


def study(folder, *words):
    done = CliRunner().invoke(main, ["study", *words, *FEW, "--out", str(folder)])
    assert done.exit_code == 0, done.output
    return pd.read_parquet(folder / "parts").set_index(["equipage", "replica"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("equipage") / "all"
    return folder, study(folder, "equipage")


def test_all_meet_the_same_encounters_and_whoever_has_nothing_flies_on(whole):
    _, runs = whole
    nominal = runs.loc["none"][["nmac_nominal", "well_clear_lost_nominal"]]
    assert nominal["well_clear_lost_nominal"].sum() > 10
    for who in ("none", "ownship", "intruder", "both", "both, coordinated"):
        assert runs.loc[who][nominal.columns].equals(nominal)
    for event in ("nmac", "well_clear_lost"):
        none = runs.loc["none"]
        assert (none[f"{event}_mitigated"] == none[f"{event}_nominal"]).all()
        kept = [runs.loc[who][f"{event}_mitigated"].sum() for who in ("ownship", "both")]
        assert none[f"{event}_nominal"].sum() > kept[0] >= kept[1]


def test_whose_radar_is_off_is_as_one_without_a_chain(whole, tmp_path):
    _, runs = whole
    scene = dsa_des.load_scene("both_avoid").resolved()
    scene["blocks"] = {n: b for n, b in scene["blocks"].items() if not n.endswith("_b")}
    scene["wires"] = [wire for wire in scene["wires"] if "_b" not in str(wire)]
    (tmp_path / "alone.toml").write_text(to_toml(scene))
    tables = {
        "scene": "alone.toml", "swap": {"traffic": "traffic.encounter_model"}, "seed": 1,
        "metrics": [{"metric": "risk_ratio", "horizontal_m": 670.56, "vertical_m": 137.16,
                     "by": []}],
        "set": {"blocks": {
            "traffic": {"file": f"{examples() / 'encounters/light_aircraft.txt'}",
                        "lat_deg": 52, "lon_deg": 4},
            "radar": {"range_km": 2, "azimuth_deg": [-110, 110]}}},
        "axes": {"equipage": {"values": ["alone"], "set": {"blocks.radar.enabled": [True]}}},
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}},
    }  # fmt: skip
    (tmp_path / "study.toml").write_text(to_toml(tables))
    alone = study(tmp_path / "out", str(tmp_path / "study.toml"))
    assert alone.loc["alone"][FLAGS].equals(runs.loc["ownship"][FLAGS])


def test_the_page_s_table_counts_what_both_bring_about(whole):
    folder, runs = whole
    lines = rows([pd.read_parquet(folder / "parts")])
    lost = {who: runs.loc[who].well_clear_lost_mitigated for who in ("ownship", "intruder", "both")}
    new = [b and not (one or other) for one, other, b in zip(*lost.values(), strict=True)]
    said = f"both: {sum(map(bool, new))} of {int(lost['both'].sum())} losses of well clear"
    assert any(line.startswith(said) for line in lines)
    assert lines[5].startswith("| ownship |") and f" | {int(lost['ownship'].sum())} | " in lines[5]
    # The ratios and their intervals are those of the study.
    ratios = pd.read_parquet(folder / "ratios.parquet").set_index(["equipage", "result"])
    one = ratios.loc["ownship", "well_clear_lost_risk_ratio"]
    assert f"{one.ratio:.3f} ({one.gamma_low:.3f} to {one.gamma_high:.3f})" in lines[5]
    change = runs.loc["both"].well_clear_lost_mitigated - lost["intruder"]
    counts = f"{int((change > 0).sum())} more and {int((change < 0).sum())} fewer losses"
    assert any(line.startswith(f"both beside intruder: {counts}") for line in lines)
