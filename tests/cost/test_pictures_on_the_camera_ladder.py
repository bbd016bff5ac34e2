"""Who asks what the signature model gets wrong is shown pictures, at their price."""

import json

from click.testing import CliRunner

from dsa_des.cli import main


def costs(tmp_path, name, *more):
    done = CliRunner().invoke(main, [
        "cost", "optical/pictures", "--swap", "eo=optical.eo", "--block", "eo", "--duration", "3",
        "--repeats", "1", "--json", "--out", str(tmp_path / name), *more,
    ])  # fmt: skip
    assert done.exit_code == 0, done.output
    return {row["rung"]: row for row in json.loads(done.stdout) if row["block"] == "eo"}


def test_pictures_are_the_top_rung_of_a_plain_camera(tmp_path):
    found = costs(tmp_path, "plain")
    picture, union = found["image"], found["union"]
    assert list(found)[-1] == "image" and not picture["unavailable"]
    # Measured: some 100 to 200 times; a busy machine may not decide whether this passes.
    assert picture["cpu_us_per_target_scan"] > 10.0 * union["cpu_us_per_target_scan"]


def test_a_camera_without_noise_says_why_it_has_no_picture(tmp_path):
    found = costs(tmp_path, "noiseless", "--set", "blocks.eo.noise_equivalent_contrast=0")
    assert "a picture has noise" in found["image"]["unavailable"]
