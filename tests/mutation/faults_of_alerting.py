"""Faults of alerting and guidance: whose state, which margin, what is remembered."""

from fault import in_file

_GROUP = "alerting"
_ESTIMATES = "wiring/test_alerts_of_estimates.py"
_EFFECTS = "alerting/test_conf_effects.py"
_MEMORY = "guidance/test_memory_of_bands.py"
_AVOIDANCE = "wiring/test_avoidance_by_bands.py"

FAULTS = [
    *in_file(
        _GROUP,
        "components/alerting/daidalus.py",
        (_ESTIMATES,),
        (
            "tracks-by-their-place",
            "np.lexsort((flights.number[column], row))",
            "np.lexsort((column, row))",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/estimated_flights.py",
        (_ESTIMATES,),
        ("tentative-tracks-count", "(CONFIRMED, COASTED)", "(CONFIRMED, COASTED, 0)"),
        (
            "estimates-are-not-carried-on",
            "row.state[:3] + row.state[3:] * ahead_s",
            "row.state[:3]",
        ),
        ("down-for-up", "east, north, -down,", "east, north, down,"),
        ("sinking-for-climbing", "            -v_down,", "            v_down,"),
        ("covariance-is-not-carried-on", "ahead_s**2 * of(i + 3, j + 3)", "0.0 * of(i + 3, j + 3)"),
        ("deviation-of-the-height-of-north", "root(later(2, 2))", "root(later(0, 0))"),
    ),
    *in_file(
        _GROUP,
        "components/alerting/encounter.py",
        (_EFFECTS,),
        (
            "wind-the-other-way",
            'np.stack([own["ve"], own["vn"]]) - through_air',
            'through_air - np.stack([own["ve"], own["vn"]])',
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/spread.py",
        (_EFFECTS,),
        (
            "spread-to-one-side",
            "(low < spread) & (high > -spread)",
            "(low < spread) & (high > 0.0)",
        ),
        ("one-edge-of-a-cell", "(unsafe[:, :-1] | unsafe[:, 1:])", "unsafe[:, :-1]"),
    ),
    *in_file(
        _GROUP,
        "components/guidance/steps.py",
        (_EFFECTS,),
        (
            "limit-above-as-below",
            "most = np.minimum(most, own_value + above)",
            "most = np.minimum(most, own_value + below)",
        ),
    ),
    *in_file(
        _GROUP,
        "components/guidance/band_memory.py",
        (_MEMORY,),
        ("one-line-fewer", "sorted(queues[1])[-self._m]", "sorted(queues[1])[-self._m + 1]"),
        ("persists-without-end", "< self._persistence_s:", "< 1e9:"),
        ("recovery-is-never-over", "if recovery is None:", "if False:"),
        ("not-across-north", "first.high + FULL_TURN, first.region)", "first.high, first.region)"),
    ),
    *in_file(
        _GROUP,
        "components/guidance/resolution_memory.py",
        (_MEMORY,),
        ("kept-for-ever", "return young or", "return True or"),
        ("sides-change-at-once", "if only_one or (old and", "if True or (old and"),
    ),
    *in_file(
        _GROUP,
        "components/avoidance/daidalus.py",
        (_AVOIDANCE,),
        (
            "always-faster",
            "beyond = change + math.copysign(self.p.beyond_mps, change)",
            "beyond = abs(change) + self.p.beyond_mps",
        ),
    ),
]
