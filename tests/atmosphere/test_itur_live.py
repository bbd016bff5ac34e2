"""The frozen table of ITU-Rpy's values is what that library says today, where it is installed."""

import csv
from pathlib import Path

import pytest

pytest.importorskip("itur", reason="pip install -e '.[oracle]'")

from tests.atmosphere.make_itur_table import table


def test_the_frozen_table_is_what_the_library_gives():
    with open(Path(__file__).with_name("itur_table.csv"), newline="") as file:
        frozen = list(csv.reader(file))[1:]
    live = table()
    assert len(frozen) == len(live) > 150
    for old, new in zip(frozen, live, strict=True):
        assert old[0] == new[0]
        assert [float(cell) for cell in old[1:-1] if cell] == [a for a in new[1:-1] if a != ""]
        assert float(old[-1]) == pytest.approx(new[-1], rel=1e-12)
