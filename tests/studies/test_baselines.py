"""A baseline is written as the axis writes its values, and is found among them."""

from pathlib import Path

import pytest

from dsa_des.errors import SceneError
from dsa_des.studies.study_file import read_study

STUDY = """
scene = "first_light"
replicas = 1
metrics = ["first_detection"]
compare = {{ axis = "{key}", baseline = {baseline} }}
axes.{key} = {values}
"""


def baseline(folder: Path, key: str, values: str, wanted: str) -> object:
    path = folder / "study.toml"
    path.write_text(STUDY.format(key=key, values=values, baseline=wanted))
    return read_study(path).baseline


@pytest.mark.parametrize(
    ("key", "values", "wanted", "label"),
    [
        ("blocks.radar.enabled", "[true, false]", "false", "false"),
        ("blocks.radar.scan_rate_hz", "['7/2', 1]", "'7/2'", 3.5),
        ("blocks.radar.azimuth_deg", "[[-110, 110], [-60, 60]]", "[-60, 60]", "[-60, 60]"),
        ("blocks.radar.scan_rate_hz", "[2, 1]", "1.0", 1),
    ],
)
def test_it_is_found(tmp_path: Path, key: str, values: str, wanted: str, label: object) -> None:
    assert baseline(tmp_path, key, values, wanted) == (key.removeprefix("blocks."), label)


def test_a_flag_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="is no value of that axis; allowed: 2, 1"):
        baseline(tmp_path, "blocks.radar.scan_rate_hz", "[2, 1]", "true")
