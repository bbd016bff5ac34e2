"""The order of execution within and between instants, asserted in full for one-topology scenes."""

import itertools
import random

import engine_blocks as blocks
import numpy as np
import pytest

from dsa_des.record.arrow import ParquetSink

MS = 10**6  # ticks of a millisecond at 10^9 ticks per second


def order(run, unit=100 * MS):
    """Return the trace with ticks in units of 0.1 s."""
    assert all(tick % unit == 0 for tick, _ in run.trace)
    return [(tick // unit, block) for tick, block in run.trace]


CHAIN = (
    {"z_source": "Pulse; scan_rate_hz = 5", "m_middle": "Relay", "a_end": "Relay"},
    ['"z_source -> m_middle -> a_end"'],
)
DIAMOND = (
    {
        "source": "Pulse; scan_rate_hz = 5",
        "right": "Relay",
        "left": "Relay",
        "longer": "Relay",
        "end": "Join",
    },
    ['"source -> right -> end"', '"source -> left -> longer -> end"'],
)
TWO_SENSORS = (
    {
        "traffic": "Demanded",
        "radar": "Sampler; scan_rate_hz = 5",
        "ir": "Sampler; scan_rate_hz = 2; offset_s = 0.1",
        "fusion": "Join",
        "tracker": "Relay",
    },
    ['"traffic -> radar -> fusion"', '"traffic -> ir -> fusion"', '"fusion -> tracker"'],
)
FEEDBACK = (
    {
        "traffic": "Demanded",
        "radar": "Cued; scan_rate_hz = 5",
        "tracker": "Relay",
    },
    [
        '"traffic.out -> radar.in"',
        '"radar -> tracker"',
        '{from = "tracker.out", to = "radar.cue", delay = "1 scan", holds = "nothing"}',
    ],
)
DELAYED = (
    {
        "source": "Pulse; scan_rate_hz = 10",
        "late": "Relay",
        "slow": "SlowRelay",
        "both": "Join",
        "sampled": "Sampler; scan_rate_hz = 4",
    },
    [
        '{from = "source", to = "late", delay_s = 0.05}',
        '{from = "source", to = "slow", delay_s = "1/10"}',
        '"late -> both"',
        '"slow -> both"',
        '"both -> sampled"',
    ],
)
MIXED = (
    {
        "a": "Pulse; scan_rate_hz = 10",
        "b": "SlowPulse; scan_rate_hz = '30000/1001'; jitter_s = 0.002",
        "c": "Pulse; scan_rate_hz = 7; rate_error_ppm = 40; offset_s = 0.02",
        "join": "Join",
        "slow_join": "SlowJoin",
        "queue": "Queuer; scan_rate_hz = 3",
        "split": "TwoOutputs",
        "own": "OwnProcess; hold_ticks = 3000000",
        "sampled": "Sampler; scan_rate_hz = 9",
        "cued": "Cued; scan_rate_hz = 6",
        "tail": "SlowRelay",
    },
    [
        '"a -> join"',
        '"b -> join"',
        '"c -> join"',
        '"join -> slow_join"',
        '{from = "c", to = "slow_join", delay_s = 0.05}',
        '"slow_join -> queue"',
        '"a -> split"',
        '"split.left -> sampled"',
        '"join -> own"',
        '"sampled.out -> cued.in"',
        '"cued -> tail"',
        '{from = "tail.out", to = "cued.cue", delay_s = 0.01, holds = {value = 3}}',
    ],
)
SCENES = {
    "chain": CHAIN,
    "diamond": DIAMOND,
    "two sensors": TWO_SENSORS,
    "feedback": FEEDBACK,
    "delayed": DELAYED,
    "mixed": MIXED,
}


def test_chain_runs_along_the_wires_whatever_the_names(lab):
    run = lab.run(lab.write(*CHAIN, duration_s=0.6), window=1)
    assert order(run) == [
        (tick, block) for tick in (0, 2, 4) for block in ("z_source", "m_middle", "a_end")
    ]


def test_diamond_runs_its_end_once_after_the_longer_side(lab):
    run = lab.run(lab.write(*DIAMOND, duration_s=0.4), window=1)
    instant = ["source", "left", "right", "longer", "end"]
    assert order(run) == [(tick, block) for tick in (0, 2) for block in instant]
    assert [row["seen"] for row in lab.rows(run.tables, "end")] == [2, 2]


def test_two_sensors_and_one_fusion(lab):
    run = lab.run(lab.write(*TWO_SENSORS, duration_s=1), window=1)
    expected = []
    for tick, sensors in [
        (0, ["radar"]),
        (1, ["ir"]),
        (2, ["radar"]),
        (4, ["radar"]),
        (6, ["ir", "radar"]),
        (8, ["radar"]),
    ]:
        expected += [(tick, block) for block in ["traffic", *sensors, "fusion", "tracker"]]
    assert order(run) == expected
    assert [row["seen"] for row in lab.rows(run.tables, "fusion")] == [1, 1, 1, 1, 2, 1]


def test_feedback_acts_one_scan_later(lab):
    run = lab.run(lab.write(*FEEDBACK, duration_s=0.8), window=1)
    instant = ["traffic", "radar", "tracker"]
    assert order(run) == [(tick, block) for tick in (0, 2, 4, 6) for block in instant]
    radar = lab.rows(run.tables, "radar")
    assert [row["seen"] for row in radar] == [0, 1, 1, 1]
    tracker = lab.rows(run.tables, "tracker")
    for k, row in enumerate(radar):
        cue = 0.25 * tracker[k - 1]["value"] if k else 0.0
        # What is left is the block's own draw, in [0, 1).
        assert 0 <= row["value"] - row["time_s"] - cue < 1


def test_feedback_of_two_scans(lab):
    cells, wires = FEEDBACK
    wires = [wire.replace("1 scan", "2 scans") for wire in wires]
    run = lab.run(lab.write(cells, wires, duration_s=1), window=1)
    assert [row["seen"] for row in lab.rows(run.tables, "radar")] == [0, 0, 1, 1, 1]


@pytest.mark.parametrize("ppm", [1, -1, 37, "1/3"])
def test_feedback_of_one_scan_with_a_rate_error_is_never_two(lab, ppm):
    cells, wires = FEEDBACK
    ppm = f'"{ppm}"' if isinstance(ppm, str) else ppm
    cells = {
        **cells,
        "radar": f"QueuedCue; scan_rate_hz = 29; rate_error_ppm = {ppm}",
        "tracker": "Relay",
    }
    run = lab.run(lab.write(cells, wires, duration_s=3), window=1)
    seen = [row["seen"] for row in lab.rows(run.tables, "radar")]
    assert seen == [0] + [1] * (len(seen) - 1)


def test_feedback_that_holds_a_table(lab):
    cells, wires = FEEDBACK
    held = [wire.replace('"nothing"', "{value = 400}") for wire in wires]
    run = lab.run(lab.write(cells, held, duration_s=0.4), window=1)
    first = lab.rows(run.tables, "radar")[0]
    assert first["seen"] == 1
    assert 100 <= first["value"] < 101


def test_feedback_by_seconds_is_seen_when_it_has_arrived(lab):
    cells, wires = FEEDBACK
    late = [wire.replace('delay = "1 scan"', "delay_s = 0.3") for wire in wires]
    run = lab.run(lab.write(cells, late, duration_s=1), window=1)
    # Scans at 0, 0.2, 0.4 ...; the first track arrives at 0.3.
    assert [row["seen"] for row in lab.rows(run.tables, "radar")] == [0, 0, 1, 1, 1]


def test_sampled_queued_and_trigger_inputs(lab):
    path = lab.write(
        {
            "source": "Pulse; scan_rate_hz = 10",
            "sampled": "Sampler; scan_rate_hz = 4",
            "queued": "Queuer; scan_rate_hz = 4",
            "triggered": "Relay",
        },
        ['"source -> sampled"', '"source -> queued"', '"source -> triggered"'],
        duration_s=0.6,
    )
    run = lab.run(path, window=1)
    at = {
        0: ["source", "queued", "sampled", "triggered"],
        5: ["source", "queued", "sampled", "triggered"],
    }
    expected = []
    for tick in range(60):
        whole = tick / 10
        if tick % 10 == 0 and int(whole) in at:
            expected += [(tick, block) for block in at[int(whole)]]
        elif tick % 10 == 0:
            expected += [(tick, "source"), (tick, "triggered")]
        elif tick % 25 == 0:
            expected += [(tick, "queued"), (tick, "sampled")]
    assert order(run, 10 * MS) == expected
    source = [row["value"] for row in lab.rows(run.tables, "source")]
    sampled = lab.rows(run.tables, "sampled")
    assert [row["value"] for row in sampled] == [source[0], source[2], source[5]]
    queued = lab.rows(run.tables, "queued")
    assert [row["seen"] for row in queued] == [1, 2, 3]
    assert queued[1]["value"] == source[1] + source[2]


def test_delayed_messages_arrive_before_any_block_of_their_instant_runs(lab):
    # The cue leaves at the instant of a scan and arrives exactly at the next one.
    cells, wires = FEEDBACK
    exact = [wire.replace('delay = "1 scan"', "delay_s = 0.2") for wire in wires]
    run = lab.run(lab.write(cells, exact, duration_s=0.6), window=1)
    assert [row["seen"] for row in lab.rows(run.tables, "radar")] == [0, 1, 1]


def test_a_delayed_wire_wakes_its_receiver_when_the_message_arrives(lab):
    path = lab.write(
        {"source": "Pulse; scan_rate_hz = 5", "late": "Relay"},
        ['{from = "source", to = "late", delay_s = 0.3}'],
        duration_s=1,
    )
    for window in (1, 2, None):
        run = lab.run(path, window=window)
        late = [row["time_s"] for row in lab.rows(run.tables, "late")]
        assert late == [0.3, 0.5, 0.7, 0.9]  # what leaves at 0.8 arrives after the end


def test_messages_of_one_instant_are_seen_in_the_order_of_their_sources(lab):
    path = lab.write(
        {
            "c": "Pulse; scan_rate_hz = 5",
            "a": "Relay",
            "b": "Pulse; scan_rate_hz = 5",
            "end": "Collector",
        },
        ['"c -> end"', '"b -> end"', '"a -> end"', '"c -> a"'],
        duration_s=0.4,
    )
    for seed in (None, 1, 2):
        lab.run(path, window=1, shuffle_ties=seed)
        seen = [(tick, source) for _, source, tick, _ in blocks.SEEN["end"]]
        assert seen == [(tick, source) for tick in (0, 200 * MS) for source in "abc"]


@pytest.mark.parametrize(
    ("duration_s", "scans"), [(1, 5), (1.2, 6), (1.000000001, 6), (0.999999999, 5), ('"1/3"', 2)]
)
def test_a_run_covers_its_start_and_not_its_end(lab, duration_s, scans):
    path = lab.write(*CHAIN, duration_s=duration_s)
    for window in (1, 2, None):
        assert len(lab.rows(lab.run(path, window=window).tables, "a_end")) == scans


def test_the_length_of_the_data_is_the_length_of_the_run(lab):
    cells = {"traffic": "Demanded; lasts_s = 0.7", "radar": "Sampler; scan_rate_hz = 10"}
    path = lab.write(cells, ['"traffic -> radar"'])
    path.write_text(
        path.read_text(encoding="utf-8").replace("duration_s = 1\n", ""), encoding="utf-8"
    )
    run = lab.run(path)
    assert run.outcome.duration_s == 0.7
    assert len(lab.rows(run.tables, "radar")) == 7


def test_a_block_with_its_own_process(lab):
    path = lab.write(
        {"source": "OwnSource", "own": "OwnProcess; hold_ticks = 20000000", "end": "Relay"},
        ['"source -> own -> end"'],
        duration_s=0.5,
    )
    run = lab.run(path, window=1)
    assert order(run, 10 * MS) == [(tick, "end") for tick in (2, 12, 22, 32, 42)]
    assert [row["value"] for row in lab.rows(run.tables, "end")] == [1, 3, 5, 7, 9]


def test_a_process_starts_at_its_own_place_in_the_first_instant(lab):
    path = lab.write(
        {"source": "Pulse; scan_rate_hz = 10", "own": "OwnReader"},
        ['"source -> own"'],
        duration_s=0.5,
    )
    for window, seed in itertools.product((1, None), (None, 4)):
        run = lab.run(path, window=window, shuffle_ties=seed)
        source = [row["value"] for row in lab.rows(run.tables, "source")]
        assert [row["value"] for row in lab.rows(run.tables, "own")] == source


def test_an_arrival_while_a_process_is_busy_is_not_lost(lab):
    path = lab.write(
        {
            "source": "Pulse; scan_rate_hz = 1; offset_s = 0.1",
            "second": "Pulse; scan_rate_hz = 1; offset_s = 0.15",
            "join": "Join",
            "own": "OwnProcess; hold_ticks = 100000000",
        },
        ['"source -> join"', '"second -> join"', '"join -> own"'],
        duration_s=1,
    )
    run = lab.run(path, window=1)
    # Busy from 0.1 to 0.2 s; what came at 0.15 s is handled from 0.2 to 0.3 s.
    assert [row["time_s"] for row in lab.rows(run.tables, "own")] == [0.2, 0.3]


def results(lab, path, **options):
    """Run into Parquet; return the Arrow tables and the bytes of every file."""
    folder = lab.folder / f"out{len(list(lab.folder.iterdir()))}"
    folder.mkdir()
    run = lab.run(path, sinks=[ParquetSink(folder)], **options)
    assert run.tables["beats"].num_rows > 0
    return run.tables, {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


@pytest.mark.parametrize("name", list(SCENES))
def test_no_choice_of_scheduling_changes_a_byte(lab, name):
    cells, wires = SCENES[name]
    path = lab.write(cells, wires, duration_s=4)
    tables, files = results(lab, path, window=1)
    choices = [{"window": window} for window in (2, 7, None)]
    choices += [
        {"window": w, "shuffle_ties": s} for w, s in [(1, 1), (1, 2), (1, 3), (None, 4), (7, 5)]
    ]
    for choice in choices:
        again, bytes_again = results(lab, path, **choice)
        assert all(again[table].equals(tables[table]) for table in tables), choice
        assert bytes_again == files, choice


@pytest.mark.parametrize("name", list(SCENES))
def test_the_order_in_the_file_changes_nothing(lab, name):
    cells, wires = SCENES[name]
    tables, files = results(lab, lab.write(cells, wires, duration_s=2), window=1)
    trace = lab.run(lab.write(cells, wires, duration_s=2), window=1).trace
    shuffler = random.Random(name)
    for _ in range(3):
        items, mixed = list(cells.items()), list(wires)
        shuffler.shuffle(items)
        shuffler.shuffle(mixed)
        path = lab.write(dict(items), mixed, duration_s=2, name="mixed.toml")
        again, bytes_again = results(lab, path, window=1)
        assert all(again[table].equals(tables[table]) for table in tables)
        assert bytes_again == files
        assert lab.run(path, window=1).trace == trace


@pytest.mark.parametrize("name", list(SCENES))
def test_recording_changes_nothing(lab, name):
    path = lab.write(*SCENES[name], duration_s=2)
    assert lab.run(path, window=1, record=False).trace == lab.run(path, window=1).trace


def test_shuffled_ties_do_change_the_order_within_a_depth(lab):
    path = lab.write(*DIAMOND, duration_s=4)
    traces = {tuple(lab.run(path, window=1, shuffle_ties=seed).trace) for seed in (1, 2, 3)}
    assert len(traces) == 3


def test_which_blocks_may_look_ahead(lab):
    run = lab.run(lab.write(*MIXED, duration_s=1))
    assert run.outcome.windowed == ["a", "c", "sampled", "split"]
    assert lab.run(lab.write(*TWO_SENSORS)).outcome.windowed == sorted(TWO_SENSORS[0])
    assert lab.run(lab.write(*FEEDBACK)).outcome.windowed == ["radar", "tracker", "traffic"]
    assert lab.run(lab.write(*TWO_SENSORS), window=1).outcome.windowed == []


def test_random_graphs_give_the_same_results_at_every_grain(lab):
    shuffler = random.Random(12)
    for number in range(8):
        cells = {}
        for i in range(3):
            kind, rate = shuffler.choice(["Pulse", "SlowPulse"]), shuffler.choice([3, 5, 10])
            cells[f"s{i}"] = f"{kind}; scan_rate_hz = {rate}"
        wires = []
        for i in range(6):
            kind = shuffler.choice(["Join", "SlowJoin", "Sampler", "Queuer"])
            many = kind.endswith("Join")
            before = shuffler.sample(list(cells), k=shuffler.choice([1, 2]) if many else 1)
            cells[f"b{i}"] = (
                kind if many else f"{kind}; scan_rate_hz = {shuffler.choice([2, 5, 6])}"
            )
            for source in before:
                delay = shuffler.choice([0, 0, 0.1, 0.05, 0.37])
                wires.append(f'{{from = "{source}", to = "b{i}", delay_s = {delay}}}')
        sending = {wire.split('"')[1] for wire in wires}
        for source in ("s0", "s1", "s2"):
            if source not in sending:
                cells[f"sink_{source}"] = "Relay"
                wires.append(f'"{source} -> sink_{source}"')
        path = lab.write(cells, wires, duration_s=3, name=f"random{number}.toml")
        tables = lab.run(path, window=1).tables["beats"]
        for window, seed in ((2, None), (5, 1), (None, None), (None, 2)):
            assert lab.run(path, window=window, shuffle_ties=seed).tables["beats"].equals(tables)


def test_a_window_must_hold_a_scan(lab):
    with pytest.raises(ValueError, match="window is 0: it must be 1 or more scans"):
        lab.run(lab.write(*CHAIN), window=0)


def test_progress_ends_at_the_end(lab):
    from dsa_des.running.simulation import Simulation
    from dsa_des.scene.scene import load_scene

    seen = []
    Simulation(load_scene(lab.write(*CHAIN, duration_s=3)), window=4).run(seen.append)
    assert seen == sorted(seen) and seen[-1] == 3 and len(seen) > 2
    assert np.all(np.diff(seen) > 0)
