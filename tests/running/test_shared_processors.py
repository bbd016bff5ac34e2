"""Latency, shared processors, and wires that lose or delay messages."""

import pytest

PIPELINE = 'processor = "gpu"'


def scene(lab, when_busy="wait", *, service="0.060", spread="0", rate=20, duration_s=2, extra=""):
    path = lab.write(
        {"camera": f"Pulse; scan_rate_hz = {rate}; {PIPELINE}", "sink": "Relay"},
        ['"camera -> sink"'],
        duration_s=duration_s,
    )
    table = (
        f"\n[processors.gpu]\nservice_s = {service}\nservice_spread_s = {spread}\n"
        f'when_busy = "{when_busy}"\n{extra}'
    )
    path.write_text(path.read_text() + table)
    return path


def outcomes(run, block=None):
    rows = run.tables["processing"].to_pylist()
    return [row for row in rows if block in (None, row["block"])]


def test_blocks_of_one_instant_line_up_by_name_whatever_the_ties(lab):
    path = lab.write(
        {
            "zeta": f"Pulse; scan_rate_hz = 2; {PIPELINE}",
            "alpha": f"Pulse; scan_rate_hz = 2; {PIPELINE}",
            "join": "Join",
        },
        ['"zeta -> join"', '"alpha -> join"'],
    )
    path.write_text(path.read_text() + "\n[processors.gpu]\nservice_s = 0.1\n")
    first = lab.run(path)
    assert [row["block"] for row in outcomes(first)] == ["alpha", "zeta"] * 2
    for options in ({"shuffle_ties": 5}, {"shuffle_ties": 6}, {"window": 1}, {"window": 3}):
        again = lab.run(path, **options)
        for name, table in first.tables.items():
            assert table.equals(again.tables[name]), (name, options)


def test_drawn_service_times_stay_in_their_spread_and_follow_the_seed(lab):
    path = scene(lab, service="0.02", spread="0.02", rate=5, duration_s=20)
    ages = [row["age_s"] for row in outcomes(lab.run(path))]
    assert 0.02 <= min(ages) < 0.024 and 0.036 < max(ages) <= 0.04
    assert ages == [row["age_s"] for row in outcomes(lab.run(path))]
    assert ages != [row["age_s"] for row in outcomes(lab.run(path, seed=4))]


def test_drawn_service_times_are_each_blocks_own(lab):
    def times(*blocks):
        scans = dict.fromkeys(blocks, f"Pulse; scan_rate_hz = 2; {PIPELINE}")
        wires = [f'"{name} -> sink"' for name in blocks]
        path = lab.write({**scans, "sink": "Join"}, wires, duration_s=5)
        table = "\n[processors.gpu]\nservice_s = 0.01\nservice_spread_s = 0.1\n"
        path.write_text(path.read_text() + table)
        found = lab.run(path)
        done = [outcomes(found, block) for block in blocks]
        return [[round(row["tick"] * 1e-9 - row["started_s"], 9) for row in each] for each in done]

    one, other = times("alpha", "zeta")
    assert len(one) == len(other) == 10 and not set(one) & set(other)
    assert times("zeta") == [other]


def faulty(lab, options, duration_s=50):
    return lab.write(
        {"radar": "Pulse; scan_rate_hz = 20", "sink": "Relay"},
        [f'{{from = "radar", to = "sink", {options}}}'],
        duration_s=duration_s,
    )


def test_late_messages_overtake_and_nothing_depends_on_the_window(lab):
    path = faulty(lab, "delay_s = 0.01, jitter_s = 0.2", duration_s=5)
    runs = [lab.run(path, window=window) for window in (None, 1, 2, 7)]
    for run in runs[1:]:
        assert runs[0].tables["beats"].equals(run.tables["beats"])
    ticks = [tick for tick, name in runs[0].trace if name == "sink"]
    assert ticks == sorted(ticks)
    assert min(ticks) >= 10_000_000
    spread = {tick % 50_000_000 for tick in ticks}
    assert len(spread) > 50, "every message has a lateness of its own"


BAD = [
    ("jitter_s = -1", "wires[0].jitter_s = -1: must be 0 or greater"),
    ("drop_probability = 1.5", "wires[0].drop_probability = 1.5: must be a number from 0 to 1"),
    ("drop_probabilty = 0.5", "did you mean 'drop_probability'"),
]


@pytest.mark.parametrize(("options", "expected"), BAD)
def test_bad_wires_are_named(lab, options, expected):
    (problem,) = lab.problems(faulty(lab, options))
    assert expected in str(problem)


def test_bad_processors_are_named(lab):
    path = scene(lab, "sleep")
    path.write_text(path.read_text().replace('processor = "gpu"', 'processor = "gpo"'))
    text = " | ".join(map(str, lab.problems(path)))
    assert "did you mean 'gpu'" in text
    assert "processors.gpu.when_busy = 'sleep'" in text and "'drop_oldest'" in text
    path.write_text(path.read_text().partition("\n[processors.gpu]")[0])
    (problem,) = lab.problems(path)
    assert "the scene has no such processor; [processors.gpo] would declare it" in str(problem)
    path = scene(lab, service="0")
    assert "must be greater than 0" in str(lab.problems(path)[0])
