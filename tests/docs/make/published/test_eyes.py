"""The section of eyes: Morris's table in closed form and flown, and the rows of the risk."""

import math

import numpy as np
import pytest

from components.formats.set_file import read_set
from docs.make.published import eyes
from docs.make.published.volumes import MODELS


def test_the_closed_form_gives_all_of_the_table():
    for speed_kt, published in eyes.MORRIS.items():
        for looking, number in zip(eyes.SHARES.values(), published, strict=True):
            found = eyes.in_closed_form(speed_kt, looking)
            assert number <= round(found, 4) < number + 0.01
    # Twice as large an aircraft shows from twice as far: by hand, 2 · 9059 kt s / 400 kt - 12.5 s.
    assert eyes.in_closed_form(400, 1.0, 80.0) == pytest.approx((45.26 - 12.5) / 36.0, abs=2e-3)
    assert eyes.in_closed_form(700, 1.0) == pytest.approx(0.0122, abs=5e-3)
    assert eyes.in_closed_form(900, 1.0) == 0.0


@pytest.mark.parametrize(("speed_kt", "looking"), [(200, 1.0), (300, 1.0 / 3.0)])
def test_flights_see_as_many(speed_kt, looking):
    share, low, high = eyes.flown(speed_kt, looking, runs=400)
    expected = eyes.in_closed_form(speed_kt, looking)
    assert low < share < high
    assert abs(share - expected) < 2.6 * math.sqrt(expected * (1.0 - expected) / 400)


def test_a_rate_gives_another_table():
    found = [eyes.by_rate(speed_kt, 420.0, 6.2) for speed_kt in eyes.MORRIS]
    assert found == sorted(found, reverse=True)
    assert (
        max(abs(f - all_[0]) for f, all_ in zip(found, eyes.MORRIS.values(), strict=True)) > 0.015
    )


def test_either_aircraft_of_an_encounter_may_be_the_one_that_is_steered(tmp_path):
    files = eyes.sets_of_both(tmp_path, MODELS / "light_aircraft.txt", 5)
    either = [eyes.flags_of(file, 5, 3, 1) for file in files]
    for name in ("nmac_nominal", "well_clear_lost_nominal", "encounter_weight"):
        assert either[0][name].tolist() == either[1][name].tolist(), name
    own, other = (read_set(file) for file in files)
    assert own.state["north_m"][::2].tolist() == other.state["north_m"][1::2].tolist()
    assert own.state["speed_mps"][1] == other.state["speed_mps"][0] != own.state["speed_mps"][0]


def test_the_rows_of_the_risk_stand_in_their_order(monkeypatch):
    flown = iter([
        {"nmac_nominal": [1.0, 1.0, 0.0], "nmac_mitigated": [1.0, 0.0, 0.0]},
        {"nmac_nominal": [1.0, 1.0, 0.0], "nmac_mitigated": [0.0, 0.0, 1.0]},
    ])  # fmt: skip
    weight = np.array([3.0, 1.0, 2.0])

    def flags_of(*_):
        flags = {name: np.array(values) for name, values in next(flown).items()}
        lost = {name.replace("nmac", "well_clear_lost"): v for name, v in flags.items()}
        return {**flags, **lost, "encounter_weight": weight}

    monkeypatch.setattr(eyes, "flags_of", flags_of)
    rows = eyes.risk_rows(MODELS / "light_aircraft.txt", encounters=3)
    assert [row.published for row in rows] == [*eyes.ONE, *eyes.BOTH]
    # By hand: 3 of 4 by the one, 2 of 4 by the other; neither leaves what both do.
    assert [row.ours for row in rows] == pytest.approx([5.0 / 8.0, 5.0 / 8.0, 0.0, 0.0])
    assert all(row.interval[0] <= row.ours <= row.interval[1] for row in rows)
