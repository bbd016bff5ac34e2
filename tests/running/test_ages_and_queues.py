"""Ages of tracks and the lines at processors, counted from the other recorded tables."""

import crooked
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, rows, run


def tracked(**tracker) -> dict:
    """A target that is seen all the time and one that leaves after 1 s; odd clocks."""
    leaving = {**crooked.ROLLING, "end_time_s": 1.0}
    sensors = {
        "radar": {**HEARS_ALL, "scan_rate_hz": 5, "offset_s": 0.05},
        "eye": {**SEES_ALL, "scan_rate_hz": 3},
    }
    return chain(
        sensors,
        targets=[leaving, crooked.DIVING],
        duration_s=4,
        fusion={"type": "fusion.pick_best"},
        tracker={"type": "tracking.stub", **tracker},
    )


@pytest.mark.parametrize("drop_after_s", [None, 1.3])
def test_a_track_s_age_is_the_time_since_the_fused_row_it_holds(drop_after_s):
    found = run(tracked(**({} if drop_after_s is None else {"drop_after_s": drop_after_s})))
    fused = rows(found, "fused")
    tracks = rows(found, "tracks")
    instants = sorted({row["time_s"] for row in fused})
    assert len(instants) > 20
    expected = {}
    for now in instants:
        for target in ("rolling", "diving"):
            held = [row for row in fused if row["target"] == target and row["time_s"] <= now]
            age = now - held[-1]["time_s"]
            if drop_after_s is None or age < drop_after_s:
                expected[now, target] = (age, held[-1]["azimuth_rad"], held[-1]["sensors"])
    ages = {(row["time_s"], row["target"]): row for row in tracks}
    if drop_after_s is not None:  # the others are told again within half a second of a drop
        dropped = {now + drop_after_s for now in instants}
        for time_s, target in ages.keys() - expected.keys():
            assert time_s not in instants and time_s % 0.5 == 0.0
            assert any(then <= time_s < then + 0.5 for then in dropped)
            assert ages[time_s, target]["age_s"] < drop_after_s
    assert {key for key in ages if key[0] in instants} == expected.keys()
    for key, (age, azimuth, sensors) in expected.items():
        assert ages[key]["age_s"] == pytest.approx(age, abs=1e-9)
        assert (ages[key]["azimuth_rad"], ages[key]["updated_by"]) == (azimuth, sensors)
    oldest = max(row["age_s"] for row in tracks if row["target"] == "rolling")
    assert oldest > (2.5 if drop_after_s is None else 1.1)


def line(when_busy: str, rates: dict[str, float], service_s: float) -> list[dict]:
    sensors = {
        name: {**HEARS_ALL, "scan_rate_hz": rate, "processor": "chip"}
        for name, rate in rates.items()
    }
    processors = {"chip": {"service_s": service_s, "when_busy": when_busy}}
    scene = chain(sensors, targets=[crooked.ROLLING], processors=processors)
    return rows(run(scene), "processing")


def test_three_messages_of_one_instant_leave_two_one_and_none_behind_them():
    done = line("wait", {"a": 1, "b": 1, "c": 1}, 0.1)
    assert [row["block"] for row in done] == ["a", "b", "c"]
    assert [row["queue_length"] for row in done] == [2, 1, 0]
    assert [row["time_s"] for row in done] == pytest.approx([0.1, 0.2, 0.3])
    assert [row["started_s"] for row in done] == pytest.approx([0.0, 0.1, 0.2])
    assert [row["age_s"] for row in done] == pytest.approx([0.1, 0.2, 0.3])


def test_the_length_of_every_line_follows_from_entries_and_outcomes():
    """Behind a message wait those that came before its outcome and were not yet worked on."""
    done = line("wait", {"a": 7, "b": 4, "c": 2}, 0.06)
    assert len(done) == 13
    assert max(row["queue_length"] for row in done) >= 2
    for row in done:
        waiting = [
            other
            for other in done
            if other["entered_s"] < row["time_s"] - 1e-9
            and other["started_s"] > row["time_s"] - 1e-9
        ]
        assert row["queue_length"] == len(waiting), row
