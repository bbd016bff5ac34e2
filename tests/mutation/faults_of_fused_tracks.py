"""Faults of fused tracks and of cues: whose report counts, how sure it is, where a cone points."""

from fault import in_file

_GROUP = "fused tracks"
_RESTS = "wiring/test_whose_reports_fused_tracks_take.py"
_LADDER = "wiring/test_tracker_ladders.py"
_CUES = "wiring/test_cue_keys.py"
_DIRECTIONS = "wiring/test_cues_of_directions.py"

FAULTS = [
    *in_file(
        _GROUP, "components/track_fusion/fused_states.py", _RESTS,
        ("who-coasts-outdoes-who-is-confirmed", "for held in (COASTED, CONFIRMED):",
         "for held in (CONFIRMED, COASTED):"),
    ),
    *in_file(
        _GROUP, "components/track_fusion/covariance_intersection.py", _RESTS,
        ("overtaken-reports-count", "made >= so_far", "made >= made"),
        ("overtaken-in-another-window", "made >= so_far",
         "made >= np.maximum.accumulate(made)"),
    ),
    *in_file(
        _GROUP, "components/track_fusion/ladder.py", _LADDER,
        ("fused-tracks-in-the-place-of-others", "told.track[mine] - 1", "told.track[mine] - 2"),
        ("spread-without-height", "for i in range(3))", "for i in range(2))"),
    ),
    *in_file(
        _GROUP, "components/tracking/cues.py", _DIRECTIONS,
        ("azimuth-as-wide-high-up", "tracks.azimuth_variance_rad2[entry] * level * level",
         "tracks.azimuth_variance_rad2[entry]"),
        ("one-sigma-of-a-direction", "self.p.sigmas * np.sqrt(told))", "np.sqrt(told))"),
        ("no-more-cones-is-not-told", "some[rows] | ~self._silent[of]", "some[rows]"),
        ("deleted-tracks-cue", "wanted = tracks.track_status != DELETED",
         "wanted = tracks.track_status > -9"),
    ),
    *in_file(
        _GROUP, "components/sensor/cued_looks.py", _CUES,
        ("alarms-in-cones-of-earlier-scans", 'first = np.searchsorted(scan, row, side="left")',
         'first = 0 * np.searchsorted(scan, row, side="left")'),
    ),
    *in_file(
        _GROUP, "components/estimation/cue_cone.py", _DIRECTIONS,
        ("directions-point-below", "-np.sin(direction[1])]", "np.sin(direction[1])]"),
    ),
]  # fmt: skip
