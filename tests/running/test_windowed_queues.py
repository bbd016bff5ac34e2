"""Shared processors that serve whole windows: the line is that of one message at a time."""

import engine_blocks
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dsa_des.errors import BlockFailure

WINDOWS = (None, 2, 3, 7, 61)


def several(lab, when_busy, service, spread, rates, *, together=True, duration_s=6):
    """Write a scene of pulses that queue for one processor, or in turn for two."""
    queues = (
        ["one"] * len(rates) if together else [("one", "two")[n % 2] for n in range(len(rates))]
    )
    blocks = {
        f"pulse_{len(rates) - n}": f'Pulse; scan_rate_hz = {rate}; processor = "{queue}"'
        for n, (rate, queue) in enumerate(zip(rates, queues, strict=True))
    }
    path = lab.write(
        {**blocks, "join": "Join"},
        [f'"{name} -> join"' for name in blocks],
        duration_s=duration_s,
    )
    table = f'service_s = {service}\nservice_spread_s = {spread}\nwhen_busy = "{when_busy}"\n'
    names = sorted(set(queues))
    path.write_text(path.read_text() + "".join(f"\n[processors.{n}]\n{table}" for n in names))
    return path


def assert_windows_do_not_matter(lab, path, *, scan_by_scan=()):
    """Run it in many windows; which blocks run scan by scan in any is said."""
    alone = lab.run(path, window=1)
    assert alone.outcome.windowed == []
    assert alone.tables["processing"].num_rows > 3
    for window in WINDOWS:
        run = lab.run(path, window=window)
        assert run.outcome.windowed == sorted(set(run.outcome.components) - set(scan_by_scan))
        assert run.tables.keys() == alone.tables.keys()
        for name, table in alone.tables.items():
            assert table.equals(run.tables[name]), (name, window)
    return alone


@pytest.mark.parametrize("when_busy", ["wait", "drop_oldest", "skip"])
@pytest.mark.parametrize("service", ["0.003", "0.05", "0.09"], ids=["idle", "busy", "overloaded"])
def test_the_line_of_three_blocks_is_the_same_in_any_window(lab, when_busy, service):
    path = several(lab, when_busy, service, "0.013", ["20", "4", "7"])
    all_of_them = ("pulse_1", "pulse_2", "pulse_3", "join")
    assert_windows_do_not_matter(lab, path, scan_by_scan=all_of_them if when_busy == "skip" else ())


@given(
    rates=st.lists(
        st.sampled_from(["1", "2", "4", "5", "10", "20", "7/3"]), min_size=1, max_size=4
    ),
    service_ms=st.integers(1, 400),
    spread_ms=st.sampled_from([0, 0, 1, 50, 300]),
    when_busy=st.sampled_from(["wait", "drop_oldest"]),
    together=st.booleans(),
)
@settings(
    max_examples=15,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_any_load_gives_the_same_line_in_any_window(
    lab, rates, service_ms, spread_ms, when_busy, together
):
    path = several(
        lab,
        when_busy,
        service_ms / 1000,
        spread_ms / 1000,
        [f'"{rate}"' for rate in rates],
        together=together,
    )
    assert_windows_do_not_matter(lab, path)


def test_a_saturated_line_is_that_of_pencil_and_paper(lab):
    """Four messages a second that take 0.4 s each: the k-th is done at 0.4 (k + 1) s."""
    rows = lab.run(several(lab, "wait", "0.4", "0", ["4"])).tables["processing"].to_pylist()
    assert [row["time_s"] for row in rows] == pytest.approx([0.4 * (k + 1) for k in range(14)])
    # Entered by 0.4 (k + 1) s, not counting that instant: ceil(1.6 (k + 1)), k + 1 of them done.
    assert [row["queue_length"] for row in rows] == [-(-8 * k // 5) - k for k in range(1, 15)]


def test_blocks_that_wait_for_each_other_run_scan_by_scan(lab):
    """A relay on the processor of the block that feeds it enters when that one is served."""
    path = lab.write(
        {
            "radar": 'Pulse; scan_rate_hz = 4; processor = "cpu"',
            "relay": 'Relay; processor = "cpu"',
            "sink": "Relay",
        },
        ['"radar -> relay"', '"relay -> sink"'],
        duration_s=3,
    )
    path.write_text(path.read_text() + "\n[processors.cpu]\nservice_s = 0.11\n")
    runs = [lab.run(path, window=window) for window in (1, *WINDOWS)]
    for run in runs[1:]:
        assert run.outcome.windowed == []
        for name, table in runs[0].tables.items():
            assert table.equals(run.tables[name]), name


def test_two_processors_that_wait_for_each_other_run_scan_by_scan(lab):
    path = lab.write(
        {
            "a": 'Pulse; scan_rate_hz = 4; processor = "one"',
            "b": 'Relay; processor = "two"',
            "c": 'Pulse; scan_rate_hz = 3; processor = "two"',
            "d": 'Relay; processor = "one"',
        },
        ['"a -> b"', '"c -> d"'],
        duration_s=3,
    )
    tables = "\n[processors.one]\nservice_s = 0.11\n\n[processors.two]\nservice_s = 0.07\n"
    path.write_text(path.read_text() + tables)
    assert_windows_do_not_matter(lab, path, scan_by_scan="abcd")


def test_what_is_behind_a_processor_that_skips_runs_scan_by_scan(lab):
    path = lab.write(
        {
            "a": 'Pulse; scan_rate_hz = 20; processor = "hasty"',
            "b": 'Relay; processor = "one"',
            "c": "Relay",
        },
        ['"a -> b"', '"b -> c"'],
        duration_s=3,
    )
    tables = (
        '\n[processors.hasty]\nservice_s = 0.07\nwhen_busy = "skip"\n'
        '\n[processors.one]\nservice_s = 0.2\nwhen_busy = "drop_oldest"\n'
    )
    path.write_text(path.read_text() + tables)
    assert_windows_do_not_matter(lab, path, scan_by_scan="abc")


@pytest.mark.parametrize("when_busy", ["wait", "drop_oldest"])
@pytest.mark.parametrize("service", ["0.004", "0.03", "0.2"])
@pytest.mark.parametrize("wire", ["", ", delay_s = 0.01, jitter_s = 0.1, drop_probability = 0.2"])
def test_who_sends_only_some_of_what_it_hears(lab, when_busy, service, wire):
    path = lab.write(
        {
            "radar": 'Pulse; scan_rate_hz = 20; processor = "cpu"',
            "other": 'Pulse; scan_rate_hz = 7; processor = "cpu"',
            "fickle": 'Fickle; processor = "cpu"',
            "relay": "Fickle",
            "last": 'Relay; processor = "slow"',
            "sink": "Join",
        },
        [
            f'{{from = "radar", to = "fickle"{wire}}}', '"fickle -> relay"',
            '"relay -> last"', '"last -> sink"', '"other -> sink"',
        ],
        duration_s=3,
    )  # fmt: skip
    text = f'service_s = {service}\nservice_spread_s = 0.02\nwhen_busy = "{when_busy}"\n'
    tables = f"\n[processors.cpu]\n{text}\n[processors.slow]\nservice_s = 0.05\n"
    path.write_text(path.read_text() + tables)
    assert_windows_do_not_matter(
        lab, path, scan_by_scan=("radar", "other", "fickle", "relay", "last", "sink")
    )


def test_a_failure_is_that_of_message_by_message(lab):
    """A block that fails in a window is said to have failed at its own instant."""
    path = several(lab, "wait", "0.06", "0.05", ["20", "7"])
    path.write_text(path.read_text().replace("[blocks.pulse_1]\n", "[blocks.pulse_1]\ngain = 2\n"))
    said = []
    for window in (1, *WINDOWS):
        with pytest.MonkeyPatch.context() as patch:
            run = engine_blocks.Join.run

            def fail(self, wake, run=run):
                for new in wake.arrivals("in"):
                    if (new.message.value > 1.6).any():
                        raise RuntimeError("too loud")
                return run(self, wake)

            patch.setattr(engine_blocks.Join, "run", fail)
            with pytest.raises(BlockFailure) as failure:
                lab.run(path, window=window)
        said.append(str(failure.value))
    assert said == said[:1] * len(said)


def test_a_processor_that_nobody_uses_changes_nothing(lab):
    path = lab.write({"radar": "Pulse; scan_rate_hz = 4", "sink": "Relay"}, ['"radar -> sink"'])
    alone = lab.run(path).tables["beats"]
    path.write_text(path.read_text() + '\n[processors.idle]\nservice_s = 1\nwhen_busy = "skip"\n')
    assert lab.run(path).tables["beats"].equals(alone)
