"""Matrices, all types, resources, clocks and time events of FMI 3, in an FMU of our own."""

from fractions import Fraction

import numpy as np
import pytest
from covering import covers

from dsa_des.errors import BlockFailure, SceneError


@pytest.fixture
def path(tmp_path):
    """Build the FMU in the test's folder."""
    import c_all_kinds

    return lambda *interval: c_all_kinds.all_kinds_fmu(tmp_path, *interval)


def signals(lab, path, text, duration_s=4, **options):
    scene = lab.write({"all": f'foreign.fmu; file = "{path}"; {text}'}, [], duration_s=duration_s)
    return lab.run(scene, **options).tables["signals"].to_pylist()


def at(rows, name, element=0):
    return {r["time_s"]: r["value"] for r in rows if (r["signal"], r["element"]) == (name, element)}


def test_matrices_have_the_shape_that_the_scene_says_row_by_row(lab, path):
    a, u = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), np.array([7.0, -8.0, 9.5])
    rows = signals(
        lab, path(), f"scan_rate_hz = 7; start = {{ rows = 2, cols = 3, A = {a.tolist()}, "
        f"u = {u.tolist()} }}", duration_s=1,
    )  # fmt: skip
    assert [at(rows, "y", i + 1)[0.0] for i in range(2)] == (a @ u).tolist()


def test_every_type_and_a_file_among_the_resources(lab, path):
    rows = signals(
        lab, path(), 'scan_rate_hz = 7; start = { whole = 3, small = -7, mode = "high", '
        'text = "Ünit 7", bytes = "00ff10" }', duration_s=1,
    )  # fmt: skip
    said = {row["signal"]: row["text"] or row["value"] for row in rows if row["time_s"] == 0.0}
    assert (said["half"], said["negative"], said["mode_out"]) == (1.5, 7, 5)
    assert (said["text_out"], said["bytes_out"], said["level"]) == ("Ünit 7", "00ff10", "fourteen")


@covers("clocks", of=("foreign.fmu",))
@pytest.mark.parametrize("window", [None, 1])
def test_clocks_of_co_simulation_tick_at_their_own_instants(lab, path, window):
    """Between communication points, too: 0.1 s + k 0.3 s, 1/7 s after each other, and by hand."""
    rows = signals(
        lab, path(), "scan_rate_hz = 7; clocks = { by_hand = [0, 0.35, 2, 2.5] }", window=window
    )
    regular, last = at(rows, "regular"), at(rows, "last_tick")
    times = [Fraction(k, 7) for k in range(28)]
    assert [regular[float(t)] for t in regular] == [
        sum(1 for k in range(100) if Fraction(1, 10) + k * Fraction(3, 10) <= t) for t in times
    ]
    ticks = [Fraction(1, 10) + k * Fraction(3, 10) for k in range(14)]
    ticks += [Fraction(0), Fraction(7, 20), Fraction(2), Fraction(5, 2)]
    for t, value in zip(times, last.values(), strict=True):
        assert value == pytest.approx(float(max(tick for tick in ticks if tick <= t)), abs=1e-12)
    assert list(at(rows, "manual").values())[-1] == 4
    assert list(at(rows, "counted").values()) == list(range(28))
    # Its own clock ticks with every third of the regular ones.
    third = at(rows, "third")
    assert sum(third.values()) == list(regular.values())[-1] // 3
    assert [t for t, n in third.items() if n] == [
        float(min(t for t in times if t >= ticks[k])) for k in (2, 5, 8, 11)
    ]


def test_a_clock_that_falls_between_ticks_is_refused(lab, path):
    with pytest.raises(SceneError, match=r"'regularly' of all\.fmu ticks at 3/7 s, which is no"):
        signals(lab, path("3/7"), "scan_rate_hz = 1")
    rows = signals(lab, path("3/7"), "scan_rate_hz = 14")
    assert list(at(rows, "regular").values())[-1] == 9
    with pytest.raises(BlockFailure, match="'counts' asks for an interval of 1/7 s, which is no"):
        signals(lab, path(), "scan_rate_hz = 10")


def test_events_are_at_the_times_that_it_says(lab, path):
    rows = signals(lab, path(), "scan_rate_hz = 0.7; start = { every = 0.23 }", duration_s=9)
    for t, count in at(rows, "events").items():
        assert count == int(t / 0.23 + 1e-9)
        assert at(rows, "last_event")[t] == pytest.approx(0.23 * count)
