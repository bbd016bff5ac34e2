"""The section of eyes: Morris's table in closed form and flown, and the rows of the risk."""

import math

import pytest

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


def test_the_rows_of_the_risk_stand_in_their_order():
    rows = eyes.risk_rows(MODELS / "light_aircraft.txt", encounters=24, workers=1)
    assert [row.published for row in rows] == [*eyes.ONE, *eyes.BOTH]
    lost, both_lost = rows[1], rows[3]
    assert 0.0 <= lost.interval[0] <= lost.ours <= lost.interval[1]
    assert both_lost.ours == pytest.approx(lost.ours**2)
