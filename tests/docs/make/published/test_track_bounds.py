"""The section of tracks: the bounds by hand, what an interval says of one, where all hold."""

import pytest

from docs.make.published.track_bounds import BOUNDS, RANGES_NMI, draw, text_of, valid_at, verdict

#: At 1 and 6 nmi, in ft, kt and ft/min.
BY_HAND = {
    ("radar", "error_across_m"): (250, 875, 0.3048),
    ("radar", "error_vertical_m"): (150, 650, 0.3048),
    ("radar", "error_horizontal_rate_m_s"): (50, 100, 0.514444),
    ("radar", "error_vertical_rate_m_s"): (800, 2200, 0.00508),
    ("active surveillance", "error_horizontal_m"): (1750, 6750, 0.3048),
    ("active surveillance", "error_horizontal_rate_m_s"): (101.5, 266.5, 0.514444),
    ("ADS-B", "error_horizontal_m"): (900, 900, 0.3048),
    ("ADS-B", "error_vertical_m"): (300, 300, 0.3048),
    ("ADS-B", "error_horizontal_rate_m_s"): (30, 30, 0.514444),
    ("ADS-B", "error_vertical_rate_m_s"): (400, 400, 0.00508),
}


def lines(beyond: float | None) -> dict:
    """Lines that keep half of every bound, and are over it at ranges from `beyond` on."""
    found = {}
    for r in RANGES_NMI:
        found["tracking.ekf", "radar", f"tracked.{r}"] = {"value": 0.9, "count": 50, "missing": 10}
        for name, _, _, bound in BOUNDS["radar"]:
            share = 2.0 if beyond is not None and r >= beyond else 0.5
            some = dict(zip(("low", "value", "high"), (0.8, 1.0, 1.2), strict=True))
            found["tracking.ekf", "radar", f"{name}.{r}"] = {
                "count": 50, **{k: v * share * bound(r) for k, v in some.items()}}  # fmt: skip
    return found


def test_bounds_are_those_of_the_table():
    known = {(sensor, name): bound for sensor, some in BOUNDS.items() for name, _, _, bound in some}
    assert known.keys() == BY_HAND.keys()
    for key, (near, far, unit) in BY_HAND.items():
        found = [known[key](1), known[key](6)]
        assert found == pytest.approx([near * unit, far * unit], rel=1e-5), key


def test_an_interval_lies_within_a_bound_or_not():
    line = {"low": 2.0, "high": 4.0}
    assert [verdict(line, b) for b in (4.0, 3.0, 1.9)] == ["met", "not shown", "not met"]


@pytest.mark.parametrize(
    ("beyond", "shown"), [(None, "1, 2, 3, 4, 5, 6"), (6, "1, 2, 3, 4, 5"), (1, "none")]
)
def test_tracks_hold_where_all_bounds_are_met(beyond, shown, tmp_path):
    found = lines(beyond)
    assert valid_at(found, "tracking.ekf", "radar") == [r for r in RANGES_NMI if r < (beyond or 9)]
    found["tracking.ekf", "radar", "error_across_m.2"] = {"low": 9e9, "value": 9e9, "high": 9e9}
    assert 2 not in valid_at(found, "tracking.ekf", "radar")
    found = lines(beyond)
    text = text_of(found)
    assert f"| radar | `tracking.ekf` | {shown} |" in text
    assert "(here 60 of radar)" in text
    assert text.count("**not met**") == (0 if beyond is None else 4 * (7 - beyond))
    found["tracking.ekf", "radar", "error_vertical_m.3"] = {
        "low": 1.0, "value": 2.0, "high": 9e9, "count": 50
    }  # fmt: skip
    assert text_of(found).count("**not shown**") == text.count("**not shown**") + 1
    draw(found, tmp_path / "drawn.png")
    assert (tmp_path / "drawn.png").stat().st_size > 5000
