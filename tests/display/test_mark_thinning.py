"""Thinning of marks, and labels that keep out of each other's way."""

import numpy as np

from components.display.symbols import Labels, by_target, evenly, staggered


def test_marks_keep_their_distance_and_the_first_one():
    along = np.linspace(0.0, 100.0, 1001)
    kept = staggered(along, 10.0, 0.0)
    assert kept[0] == 0
    assert np.allclose(np.diff(along[kept]), 10.0)


def test_two_sensors_take_turns():
    along = np.linspace(0.0, 100.0, 1001)
    one, other = (along[staggered(along, 10.0, phase)[1:]] for phase in (0.0, 0.5))
    assert np.abs(one[:, None] - other).min() >= 4.9


def test_gaps_stay_gaps_and_unknown_places_are_left_out():
    along = np.array([np.nan, 0.0, 1.0, 80.0, 81.0, np.nan])
    assert staggered(along, 10.0, 0.0).tolist() == [1, 3]
    assert staggered(np.full(3, np.nan), 10.0, 0.0).tolist() == []
    assert staggered(np.zeros(5), 10.0, 0.3).tolist() == [0]


def test_evenly_keeps_both_ends():
    assert evenly(3, 5).tolist() == [0, 1, 2]
    kept = evenly(1000, 7)
    assert (kept[0], kept[-1], len(kept)) == (0, 999, 7)


def test_rows_by_target():
    groups = by_target(np.array([2, 0, 2, 5, 0]))
    assert [(target, rows.tolist()) for target, rows in groups] == [
        (0, [1, 4]),
        (2, [0, 2]),
        (5, [3]),
    ]
    assert by_target(np.empty(0, dtype=np.int64)) == []


class PretendAxes:
    def __init__(self):
        self.places = []

    def text(self, x, y, text, **kwargs):
        self.places.append((x, y))


def test_labels_of_one_place_do_not_share_it():
    axes = PretendAxes()
    labels = Labels(axes, (0.0, 500.0), (0.0, 500.0), 1.0, np.full((1, 2), np.nan))
    for name in ("one", "two", "three", "four"):
        labels.add(name, 250.0, 250.0)
    boxes = labels._taken
    for i, one in enumerate(boxes):
        for other in boxes[i + 1 :]:
            apart = (
                one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
            )
            assert apart


def test_labels_keep_off_tracks_and_inside_the_map():
    axes = PretendAxes()
    # A track that leaves the point to the right, where a label would go first.
    track = np.column_stack((np.linspace(480.0, 500.0, 50), np.full(50, 250.0)))
    labels = Labels(axes, (0.0, 500.0), (0.0, 500.0), 1.0, track)
    labels.add("name", 480.0, 250.0)
    left, _, right, _ = labels._taken[0]
    assert 0.0 <= left < right <= 480.0
