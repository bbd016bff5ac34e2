"""What trackers are timed beside does the same work: the same states from the same detections."""

import numpy as np
import pytest

from components.benchmark.track_updates import (
    LOOKS,
    _recorded_scans_and_poses,
    _start_tracks,
    plain_looks,
    prepare_plain_updates,
    prepare_stone_soup_updates,
    record_tracker_inputs,
    track_plainly,
)
from components.messages.state_tracks import COVARIANCE


def test_the_plain_loop_comes_to_the_states_of_our_tracker():
    block = record_tracker_inputs(1, 4)
    scans, places = _recorded_scans_and_poses(block)
    looks = plain_looks(scans, places, block.context.ticks_per_s)
    assert sorted({look.measured.shape[1] for look in looks}) == [2, 3] and len(looks) == LOOKS
    first = _start_tracks(scans, places, block.p.start_speed_m_s)
    states, covariances = track_plainly(
        looks[1:], *first, block.p.acceleration_intensity_m2_s3, looks[0].time_s
    )
    ours, spreads = block._store.states_by_model()[0], block._store.covariances_by_model()[0]
    assert ours.shape == (6, 4) and len(COVARIANCE) == 21
    for k in range(4):
        j = int(np.argmin([np.abs(s[:3] - ours[:3, k]).max() for s in states]))
        np.testing.assert_allclose(states[j], ours[:, k], rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(covariances[j], spreads[:, :, k], rtol=1e-6, atol=1e-7)


def test_updates_are_counted_and_done():
    count, track = prepare_plain_updates(2)
    assert count == 2 * (LOOKS - 1)
    states, _ = track()
    assert len(states) == 2


def test_stone_soup_tracks_the_same_detections():
    pytest.importorskip("stonesoup", reason="needs the extra stonesoup")
    count, track = prepare_stone_soup_updates(2)
    assert count == 2 * 26
    track()
