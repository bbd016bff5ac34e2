"""``[[outages]]``: how often and how long, alone or together, beside other runs."""

import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of
from test_changes_while_a_run_lasts import change, scans_of, scene

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.errors import SceneError
from dsa_des.record.failure_counts import failure_sentences
from dsa_des.stretches.outage import Outage
from dsa_des.stretches.outages import Outages
from dsa_des.time.randomness import Streams
from dsa_des.time.timeline_runs import Runs


def outage(*blocks, **keys):
    return {"blocks": [*blocks], "mean_between_s": 8, "mean_repair_s": 4, **keys}


def spans_s(outages):
    """Return when something fails and is back in the first run, in seconds of whole ticks."""
    return outages._edges[0].tick.reshape(outages._runs.count, -1)[0].reshape(-1, 2)


def test_times_between_failures_and_out_of_work_are_those_asked_for():
    runs = Runs(40, 100_000)
    failing = Outage(blocks=["radar"], mean_between_s=50, mean_repair_s=7, restart_s=3)
    outages = Outages([failing], Streams(range(40)), runs, 10)
    edges = [of[of < 100_000] / 10 for of in outages._edges[0].tick.reshape(40, -1)]
    out = np.concatenate([(of[1::2] - of[: len(of) // 2 * 2 : 2]) for of in edges])
    up = np.concatenate([of[2::2] - of[1::2][: len(of[2::2])] for of in edges])
    many = len(out)
    assert many == pytest.approx(40 * 10_000 / 60, rel=0.05)
    assert out.min() >= 3
    assert (out - 3).mean() == pytest.approx(7, abs=4 * 7 / many**0.5)
    assert up.mean() == pytest.approx(50, abs=4 * 50 / many**0.5)
    # Exponential times: a share of 1/e lasts longer than the mean.
    assert (up > 50).mean() == pytest.approx(np.exp(-1), abs=4 * 0.5 / many**0.5)
    instants = RunTicks.of_run(0, np.arange(0, 100_000, 7))
    down = ~outages.is_up(instants)
    inside = np.zeros(len(down), dtype=bool)
    for first, last in spans_s(outages):
        inside |= (instants.tick >= first) & (instants.tick < last)
    assert (down == inside).all()
    assert down.mean() == pytest.approx(10 / 60, abs=0.03)


@covers("outages", of=("[scene]",))
@covers("blocks", "mean_between_s", "mean_repair_s", of=("[outages]",))
def test_a_block_that_is_out_does_not_scan_in_any_window_and_beside_other_runs():
    failing = scene(change("blocks.radar.scan_rate_hz", 4), tracks=True,
                    outages=[outage("radar"), outage("tracker", restart_s=1)])  # fmt: skip
    whole = same_in_any_window(failing, windows=(1, 5))
    same_as_alone(replicas_of(failing, {}, {}, {}), window=30)
    _, never = tables_of(scene(change("blocks.radar.scan_rate_hz", 4), tracks=True))
    all_scans, scans = scans_of(never["scans"]), scans_of(whole["scans"])
    assert 0.2 * len(all_scans) < len(scans) < 0.95 * len(all_scans)
    assert set(scans) < set(all_scans)
    # What it is as long as it works is the same as if it never failed.
    kept = [t in set(scans) for t in all_scans]
    assert never["scans"].filter(kept).equals(whole["scans"])


def test_what_comes_over_the_wires_of_a_block_that_is_out_is_lost():
    late = ["traffic -> transform -> gate", "gate -> radar",
            {"from": "radar", "to": "fusion", "delay_s": 0.3}]  # fmt: skip
    failing = scene(wires=late, outages=[outage("fusion")])
    simulation, tables = tables_of(failing)
    _, never = tables_of(scene(wires=late))
    arrived = scans_of(never["fused"])
    at = RunTicks.of_run(0, np.rint(np.array(arrived) * 1e9).astype(np.int64))
    up = simulation.timeline.outages("fusion").is_up(at)
    assert 0.1 < up.mean() < 0.9
    assert tables["fused"].equals(never["fused"].filter(up))


def test_what_came_while_a_tracker_was_out_is_lost_scan_by_scan_too():
    """It wakes by itself twice a second: what came before, while it was out, does not come then."""
    late = ["traffic -> transform -> gate", "gate -> radar", "fusion -> tracker",
            "traffic -> alerting.states", "tracker -> alerting.estimates",
            {"from": "radar", "to": "fusion", "delay_s": 0.3}]  # fmt: skip
    failing = scene(tracks=True, wires=late, outages=[outage("tracker")])
    whole = same_in_any_window(failing, windows=(1,))
    assert whole["state_tracks"].num_rows


@covers("restart_s", of=("[outages]",))
def test_a_restart_takes_its_time():
    def missing(**keys):
        simulation, _ = tables_of(scene(outages=[outage("radar", **keys)]))
        return simulation.timeline.outages("radar")

    spans, longer = (spans_s(missing(**keys)) / 1e9 for keys in ({}, {"restart_s": 1.5}))
    lasts, last_longer = (of[:, 1] - of[:, 0] for of in (spans[:2], longer[:2]))
    assert last_longer == pytest.approx(lasts + 1.5)
    assert longer[1, 0] - longer[0, 1] == pytest.approx(spans[1, 0] - spans[0, 1])


@covers("name", of=("[outages]",))
def test_what_fails_together_is_out_together_and_draws_by_its_name():
    bus = scene(tracks=True, outages=[outage("radar", "tracker", name="bus")])
    simulation, _ = tables_of(bus)
    radar, tracker = (spans_s(simulation.timeline.outages(n)) for n in ("radar", "tracker"))
    assert (radar == tracker).all()
    other, _ = tables_of(scene(outages=[outage("radar", name="other")]))
    assert not np.array_equal(spans_s(other.timeline.outages("radar")), radar)
    said = simulation.timeline.outages("radar").failure_counts()["seconds failed"]
    out_s = sum(np.minimum(last, 40e9) - np.minimum(first, 40e9) for first, last in radar) / 1e9
    assert said.tolist() == [[round(out_s)], [40]]
    assert failure_sentences({"radar": {"seconds failed": (3, 600)}}) == [
        "radar: seconds failed: 3 of 600 (0.5 %)"
    ]  # though a block that lacks something so seldom is not worth a sentence


MEASURED = ["azimuth_rad", "elevation_rad", "range_m", "confidence", "snr_db"]


def by_scan(table):
    """Return what was measured, and whether of nothing that is there, by tick of the scan."""
    found = {}
    columns = [table[name].to_pylist() for name in ("tick", "target", *MEASURED)]
    for tick, target, *values in zip(*columns, strict=True):
        found.setdefault(tick, []).append((target is None, values))
    return found


def last_good(ticks, spans):
    """Return, of each instant, itself, or the last one before it that lies in no span."""
    good = [not any(first <= tick < last for first, last in spans) for tick in ticks]
    return [next((ticks[k] for k in range(n, -1, -1) if good[k]), None) for n in range(len(ticks))]


@covers("mode", of=("[outages]",))
def test_a_frozen_radar_sends_its_last_detections_again_and_again():
    frozen = [outage("radar", mode="frozen")]
    made = scene(change("blocks.radar.scan_rate_hz", 4), tracks=True, outages=frozen)
    got = same_in_any_window(made, windows=(1, 5))
    same_as_alone(replicas_of(made, {}, {}, {}), window=30)
    simulation, never = tables_of(scene(change("blocks.radar.scan_rate_hz", 4), tracks=True))
    spans = Outages(made.outages, Streams([3]), simulation.runs, 10**9).outage_spans(0)
    columns = [n for n in never["scans"].column_names if n != "detected"]
    assert got["scans"].select(columns).equals(never["scans"].select(columns))
    ticks = never["scans"]["tick"].to_pylist()
    mine, theirs = by_scan(got["detections"]), by_scan(never["detections"])
    sources = last_good(ticks, spans)
    assert 10 < sum(tick != source for tick, source in zip(ticks, sources, strict=True)) < 100
    for tick, source in zip(ticks, sources, strict=True):
        want = [(tick != source, values) for _, values in theirs.get(source, [])]
        assert mine.get(tick, []) == want
    false = got["detections"].filter(got["detections"]["target"].is_null())
    assert false["true_range_m"].null_count == len(false) > 0
    # One that is frozen before its first scan has no values of its own, and sends none of others.
    early = scene(duration_s=12, outages=[outage("radar", mode="frozen", mean_between_s=2)])
    loud = {"blocks.radar.offset_s": 3, "blocks.radar.power_w": 8000}
    same_as_alone(replicas_of(early, *[loud] * 4), window=30)


@covers("stuck", of=("[outages]",))
@pytest.mark.parametrize(
    ("quantity", "column", "worth"), [("range_m", "range_m", 512.0),
                                      ("azimuth_deg", "azimuth_rad", np.radians(45.0))],
)  # fmt: skip
def test_a_bit_that_sticks_is_set_in_every_value_while_it_does(quantity, column, worth):
    stuck = {"mode": "stuck_bit", "stuck": {quantity: 512.0 if "m" in quantity[-2:] else 45.0}}
    made = scene(outages=[outage("radar", **stuck)])
    simulation, tables = tables_of(made)
    spans = Outages(made.outages, Streams([3]), simulation.runs, 10**9).outage_spans(0)
    got, never = tables["detections"], tables_of(scene())[1]["detections"]
    assert got.drop_columns([column]).equals(never.drop_columns([column]))
    out = [any(a <= t < b for a, b in spans) for t in never["tick"].to_pylist()]
    changed = 0
    for tick_out, was, is_now in zip(
        out, never[column].to_pylist(), got[column].to_pylist(), strict=True
    ):
        # An angle is a word of a whole turn: below 0 it is one just under 360 degrees.
        word = was % (2 * np.pi) if column == "azimuth_rad" else was
        want = was if not tick_out or int(word / worth) & 1 else was + worth
        assert is_now == pytest.approx(want, abs=1e-9)
        changed += want != was
    assert 0.02 * len(out) < changed < len(out)


def test_wrong_outages_are_said():
    for entry, said in (
        (outage("rader"), "did you mean 'radar'?"),
        (outage(), "blocks"),
        (outage("radar", "radar"), "each stands there once"),
        (outage("radar", mean_between_s=0), "greater than 0"),
        (outage("radar", mean_between_s=1e-5), "at most 100,000 failures"),
        (outage("radar", every_s=3), "every_s"),
        (outage("radar", mode="dead"), "'frozen'"),
        (outage("radar", mode="stuck_bit"), "stuck = { QUANTITY = WORTH }"),
        (outage("radar", stuck={"range_m": 8}), "the one asks for the other"),
        (outage("radar", mode="stuck_bit", stuck={"range": 8}), "did you mean 'range_m'?"),
        (outage("radar", mode="stuck_bit", stuck={"range_m": 0}), "must be greater than 0"),
        (outage("gate", mode="frozen"), "gate sends no values of a sensor"),
    ):
        with pytest.raises(SceneError) as wrong:
            scene(outages=[entry])
        assert said in str(wrong.value)
    with pytest.raises(SceneError, match="give each a name of its own"):
        scene(outages=[outage("radar"), outage("radar")])
