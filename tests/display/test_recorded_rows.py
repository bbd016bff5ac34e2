"""Runs of any length are summed up and drawn in the same memory."""

import itertools
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import given
from hypothesis import strategies as st

from components.display import recorded_rows, tracks
from components.display.recorded_rows import (
    Detected,
    index_in_groups,
    read_scans,
    row_strides,
    scans_between,
    thin_rows,
)
from components.display.summary import FusedSummary, SensorSummary
from dsa_des.block.message import Text

series = st.lists(st.integers(0, 6), max_size=300)


def kept(rows, pieces, most):
    """Return series and number of the rows kept of a stream that comes in pieces."""
    place = np.arange(len(rows), dtype=float)
    numbers = {one: number for number, one in enumerate(dict.fromkeys(rows))}
    series = np.array([numbers[one] for one in rows], dtype=np.int64)
    cuts = list(itertools.pairwise([0, *sorted(pieces), len(rows)]))
    found, (where,) = thin_rows(lambda: [(series[a:b], place[a:b]) for a, b in cuts], most, 1)
    assert np.all(np.diff(where) > 0)
    assert [numbers[rows[int(i)]] for i in where] == found.tolist()
    return where.astype(int).tolist()


@given(series, st.lists(st.integers(0, 300), max_size=5), st.integers(1, 80))
def test_what_is_kept_is_bounded_and_the_same_in_any_pieces(rows, cuts, most):
    cuts = [min(cut, len(rows)) for cut in cuts]
    where = kept(rows, cuts, most)
    assert where == kept(rows, [], most)
    assert len(where) <= max(most, len(set(rows)))
    if len(rows) <= most:
        assert where == list(range(len(rows)))
    # The first row of each series is kept, and rows of one series are evenly apart.
    for one in set(rows):
        places = [i for i, number in enumerate(rows) if number == one]
        numbers = [places.index(i) for i in where if rows[i] == one]
        assert numbers[0] == 0
        assert len(set(np.diff(numbers))) <= 1


@given(st.lists(st.integers(0, 500), min_size=1, max_size=8), st.integers(1, 300), st.data())
def test_strides_never_shrink_and_short_series_are_spared(counts, most, data):
    more = [n + data.draw(st.integers(0, 200)) for n in counts]
    before, after = (row_strides(np.array(c), most) for c in (counts, more))
    assert np.all(after >= before)
    total = int(np.sum(-(-np.array(counts) // before)))
    assert total <= max(most, len(counts))
    order = np.argsort(counts, kind="stable")
    assert np.all(np.diff(before[order]) >= 0)


@given(series)
def test_places_in_groups(rows):
    wanted = [rows[:i].count(one) for i, one in enumerate(rows)]
    assert index_in_groups(np.array(rows, dtype=np.int64)).tolist() == wanted


def write(folder, name, columns, group=64):
    pq.write_table(pa.table(columns), folder / f"{name}.parquet", row_group_size=group)


def test_a_rare_target_stays_beside_one_that_is_always_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "MOST_ROWS", 500)
    count = 20_000
    rare = np.isin(np.arange(count), [7, 9_000, 19_990])
    names = np.where(rare, "rare", "always").astype(object)
    names[100:200] = None  # false alarms
    columns = {"block": ["a", "b"] * (count // 2), "target": names.tolist(),
               "time_s": np.arange(count) / 10, "true_range_m": np.arange(count) * 1.0}  # fmt: skip
    write(tmp_path, "detections", columns)
    found = Detected.read(tmp_path, ["a", "b", "c"])
    assert found.sensors == ["a", "b", "c"]
    rare_s = [t for name in "ab" for t in found.time_s[name][found.target[name] == 1].tolist()]
    assert found.names == ["always", "rare"]
    assert sorted(rare_s) == [0.7, 900.0, 1999.0]
    assert 200 < sum(map(len, found.time_s.values())) <= 500


@given(
    st.lists(st.tuples(st.sampled_from("abc"), st.booleans()), min_size=1, max_size=60),
    st.floats(0, 60),
    st.floats(0, 30),
    st.integers(1, 9),
)
def test_scans_are_found_as_by_looking_at_all(tmp_path_factory, rows, start_s, length_s, group):
    folder = tmp_path_factory.mktemp("run")
    time_s = np.arange(len(rows), dtype=float)
    hit = np.array([detected for _, detected in rows])
    block = np.array([name for name, _ in rows])
    columns = {"block": block.tolist(), "time_s": time_s, "detected": hit.astype(np.int64)}
    write(folder, "scans", columns, group)
    scans = read_scans(folder)
    shown = scans_between(folder, start_s, start_s + length_s, scans)
    assert list(scans) == list(shown) == sorted(set(block.tolist()))
    for name, one in scans.items():
        mine = time_s[block == name]
        hits = time_s[(block == name) & hit]
        assert one.first_s.tolist() == mine.tolist()
        assert one.first_hit_s == (hits[0] if len(hits) else None)
        inside = (mine >= start_s) & (mine <= start_s + length_s)
        assert shown[name].time_s.tolist() == mine[inside].tolist()
        wanted = hits[(hits >= start_s) & (hits <= start_s + length_s)]
        assert shown[name].hit_s.tolist() == [*hits[hits < start_s][-1:], *wanted]


def batch(number, rows=2000):
    """Return one window's rows of a long run: two sensors, three targets and false alarms."""
    at = np.arange(number * rows, (number + 1) * rows)
    return {
        "block": Text((at % 2).astype(np.int32), ("eo", "radar")),
        "target": Text((at % 4).astype(np.int32) - 1, ("a", "b", "c")),
        "tick": at,
        "time_s": at / 10,
        "true_range_m": 1000.0 + (at * 37) % 500,
        "evaluated": at % 3,
    }


def fed(batches):
    """Return the peak of memory of summaries that are fed with batches, in bytes."""
    observer = SensorSummary(["eo", "radar"])
    tracemalloc.start()
    for number in range(batches):
        observer.update("scans", batch(number))
        observer.update("detections", batch(number))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert observer.result()["sensors"]["eo"]["scans"] == batches * 1000
    return peak


def test_a_summary_takes_the_same_memory_however_long_the_run():
    fed(2)
    assert fed(200) < 1.2 * fed(10)


def drawn(folder, groups):
    """Return the peak of memory of reading a run's tables for figures, in bytes."""
    schema = pa.schema([("block", pa.string()), ("target", pa.string()), ("time_s", pa.float64()),
                        ("true_range_m", pa.float64()), ("detected", pa.int64())])  # fmt: skip
    for table in ("detections", "scans"):
        with pq.ParquetWriter(folder / f"{table}.parquet", schema) as writer:
            for number in range(groups):
                time_s = np.arange(number * 4000, number * 4000 + 4000) / 10
                columns = [["radar"] * 4000, ["a", "b"] * 2000, time_s, time_s, [1] * 4000]
                writer.write_table(pa.table(columns, schema=schema))
    tracemalloc.start()
    detected = Detected.read(folder, ["radar"])
    scans = read_scans(folder)
    shown = scans_between(folder, 50.0, 60.0, scans)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(scans["radar"].first_s) == 1000 and round(scans["radar"].period_s or 0, 9) == 0.1
    assert len(shown["radar"].time_s) == 101
    assert len(detected.time_s["radar"]) <= recorded_rows.MOST_ROWS
    return peak


def test_reading_for_figures_takes_the_same_memory_however_long_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "MOST_ROWS", 6000)
    drawn(tmp_path, 2)
    assert drawn(tmp_path, 60) < 1.3 * drawn(tmp_path, 6)


rows_of_a_run = st.lists(
    st.tuples(
        st.integers(0, 1),  # sensor
        st.integers(-1, 2),  # target
        st.integers(0, 3),  # ticks since the row before
        st.sampled_from([float("nan"), 10.0, 20.0, 30.0]),
    ),
    max_size=40,
)


@given(rows_of_a_run, st.lists(st.integers(0, 40), max_size=4))
def test_a_summary_is_that_of_all_rows_together(rows, cuts):
    sensors, targets, steps, ranges = (
        (list(column) for column in zip(*rows, strict=True)) if rows else ([], [], [], [])
    )
    ticks = np.cumsum(np.array(steps, dtype=np.int64))
    observer = SensorSummary(["eo", "radar"])
    fused = FusedSummary()
    bounds = [0, *sorted(min(cut, len(rows)) for cut in cuts), len(rows)]
    for start, end in itertools.pairwise(bounds):
        part = slice(start, end)
        observer.update("detections", {
            "block": Text(np.array(sensors[part], dtype=np.int32), ("eo", "radar")),
            "target": Text(np.array(targets[part], dtype=np.int32), ("a", "b", "c")),
            "tick": ticks[part], "time_s": ticks[part] / 10,
            "true_range_m": np.array(ranges[part], dtype=np.float64),
        })  # fmt: skip
        fused.update("fused", {"sensors": Text(np.array(sensors[part], dtype=np.int32),
                                               ("eo", "eo+radar"))})  # fmt: skip
    for number, name in enumerate(("eo", "radar")):
        mine = [i for i in range(len(rows)) if sensors[i] == number]
        true = [i for i in mine if targets[i] >= 0]
        entry = observer.result()["sensors"][name]
        assert entry["detections"] == len(true)
        # Who detected no target and looked at none cannot say whose these are.
        others = "false_alarms" if true else "unnamed_detections"
        assert entry.get(others, 0) == len(mine) - len(true)
        for which, pick in (("first_detection", min), ("last_detection", max)):
            if not true:
                assert entry[which] is None
                continue
            instant = pick(ticks[i] for i in true)
            there = [i for i in true if ticks[i] == instant]
            known = [ranges[i] for i in there if ranges[i] == ranges[i]]
            assert entry[which]["time_s"] == instant / 10
            assert entry[which]["range_m"] == (min(known) if known else None)
            assert entry[which]["target"] in {
                "abc"[targets[i]] for i in there if not known or ranges[i] == min(known)
            }
        wanted = sensors.count(number)
        assert fused.result()["fused"].get(("eo", "eo+radar")[number], 0) == wanted


def test_no_row_at_all_is_no_detection(tmp_path):
    assert Detected.read(tmp_path, ["a"]).names == []
    assert read_scans(tmp_path) == {}
    assert scans_between(tmp_path, 0.0, 1.0, {}) == {}


def tracks_drawn(folder, groups):
    """Return the peak of memory of reading the tracks of a run, three at each instant, in bytes."""
    text = ("block", "track_status")
    schema = pa.schema([(name, pa.string() if name in text else pa.float64())
                        for name in tracks._COLUMNS])  # fmt: skip
    schema = schema.set(schema.get_field_index("tick"), pa.field("tick", pa.int64()))
    schema = schema.set(schema.get_field_index("track"), pa.field("track", pa.int64()))
    schema = schema.set(schema.get_field_index("has_range"), pa.field("has_range", pa.bool_()))
    rows = 6000
    with pq.ParquetWriter(folder / "state_tracks.parquet", schema) as writer:
        for number in range(groups):
            instant = np.repeat(np.arange(number * rows // 3, (number + 1) * rows // 3), 3)
            columns = {name: np.full(rows, 1.0) for name in tracks._COLUMNS}
            columns |= {
                "tick": instant * 500_000_000, "state_s": instant / 2.0,
                "track": np.tile([1, 2, 3], rows // 3), "has_range": np.ones(rows, dtype=bool),
                "block": ["tracker"] * rows, "track_status": ["confirmed"] * rows,
            }  # fmt: skip
            if number == 1:  # a short one, of two rows
                columns["track"][7:9] = 4
            writer.write_table(pa.table([columns[name] for name in schema.names], schema=schema))
    tracker = SimpleNamespace(context=SimpleNamespace(platform="ownship"))
    tracemalloc.start()
    found = tracks.DrawnTracks.read(SimpleNamespace(components={"tracker": tracker}), folder)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    counts = {one.number: len(one.columns["state_s"]) for one in found.tracks}
    assert counts.pop(4) == 2
    assert max(counts.values()) < 1.2 * min(counts.values())
    kept = sum(counts.values())
    assert min(groups * rows, 5000) * 0.7 < kept < 6000 * 1.2 + 600
    return peak


def test_drawing_tracks_takes_the_same_memory_however_long_the_run(tmp_path, monkeypatch):
    """Every third row would be of one track alone; a short track is whole."""
    monkeypatch.setattr(tracks, "_KEPT_ROWS", 6000)
    tracks_drawn(tmp_path, 2)
    assert tracks_drawn(tmp_path, 40) < 1.3 * tracks_drawn(tmp_path, 5)


def test_scans_are_read_from_their_own_table(tmp_path):
    time_s = np.arange(6.0)
    columns = {"block": ["a", "b"] * 3, "time_s": time_s, "detected": [0, 1, 1, 0, 1, 1]}
    write(tmp_path, "scans", columns)
    write(tmp_path, "detections", columns | {"time_s": time_s + 0.25})
    shown = scans_between(tmp_path, 2.0, 4.0, ["a", "b"])
    assert [shown[name].time_s.tolist() for name in "ab"] == [[2.0, 4.0], [3.0]]
    assert [shown[name].hit_s.tolist() for name in "ab"] == [[2.0, 4.0], [1.0]]
