"""The ladders of radars: how an echo becomes a detection, and how large the target's RCS is."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.aircraft.known_targets import offered_rosters
from components.sensor.ladder_values import make_cell_measure, over_cells
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.block.ladder import Ladder, Quantity, Rung, Unavailable
from dsa_des.block.wake import Wake

_PD = Quantity("detection_probability", "Pd", tolerance="detection_probability")


def _pd_of(radar: Any, cells: Cells) -> FloatArray:
    """Return each cell's probability of detection; 1 or 0 if a threshold decides."""
    look = radar.look(cells)
    if "detection_probability" in look.extras:
        echo: FloatArray = np.where(
            radar.snr(cells) > 0.0, look.extras["detection_probability"], 0.0
        )
        return echo
    return np.where(look.detected, 1.0, 0.0)


def pd_truth_errors(block: Component, wake: Wake, cells: IntArray) -> dict[str, FloatArray]:
    """Return the cells' absolute errors of Pd, against sums at 40 digits (needs mpmath)."""
    from components.high_precision.detection import detection_probability_error

    radar: Any = block
    if not hasattr(radar, "swerling_models_and_cells"):
        raise Unavailable("a boundary or threshold decides: it states no probability")
    if any(map(radar.built, ("clutter", "Doppler", "threshold from reference cells"))):
        raise Unavailable("clutter, filter or CFAR: no evaluation at more digits")
    at: dict[str, FloatArray] = {}

    def values(cells: Cells) -> dict[str, FloatArray]:
        model = np.empty(len(cells))
        for number, chosen in radar.swerling_models_and_cells(cells):
            model[chosen] = number
        return {"snr": radar.snr(cells), "model": model, "pd": _pd_of(radar, cells)}

    at = over_cells(radar, wake, values)
    errors = [
        detection_probability_error(
            at["pd"][row, target],
            at["snr"][row, target],
            radar.p.pulses_summed,
            radar.p.false_alarm_probability,
            int(at["model"][row, target]),
        )
        for row, target in cells.tolist()
        if at["snr"][row, target] > 0.0
    ]
    return {_PD.name: np.array(errors)}


def _rcs_and_pd(radar: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return each cell's mean RCS and probability of detection, as columns."""
    return {"rcs": radar.mean_rcs_m2(cells), _PD.name: _pd_of(radar, cells)}


def _boundary_settings(block: Mapping[str, Any]) -> dict[str, Any]:
    """Return the equivalent range boundary's settings: calibrated range, else ``range_km``."""
    if block["type"] == "radar.range_boundary":
        return {}
    if block.get("calibrate"):
        return {"range_km": block["calibrate"]["range_km"]}
    if block.get("range_km"):
        return {"range_km": block["range_km"]}
    raise Unavailable("needs calibrate.range_km or range_km to put the boundary at")


def _cfar_note(block: Component) -> str:
    cells = getattr(block.p, "cfar_reference_cells", None)
    return "" if cells is None else f"cfar_reference_cells is {cells}: Pd has one method with CFAR"


def _no_rcs_table_note(block: Component) -> str:
    rosters = offered_rosters(block.context)
    if rosters and not any(craft.rcs_table for roster in rosters for craft in roster.aircraft):
        return "no target has an rcs_table"
    return ""


DETECTION = Ladder(
    "detection",
    (
        Rung("range_boundary", "all inside the calibrated range (section 2.2.2)",
             "radar.range_boundary", _boundary_settings),
        Rung("threshold", "mean SNR against a threshold", "radar.threshold"),
        Rung("gram_charlier", "thesis eq. 26-31 at a sampled RCS", "radar.swerling",
             {"detection": "gram_charlier"}, {"fluctuation": "sampled"}),
        Rung("table", "Pd looked up, error below 1e-6", "radar.swerling",
             {"detection": "table"}),
        Rung("exact", "Pd to 12 digits", "radar.swerling", {"detection": "exact"}),
    ),
    "exact",
    (_PD,),
    # What is too far away to be looked at is detected with probability 0.
    make_cell_measure(lambda radar, cells: {_PD.name: _pd_of(radar, cells)}, out_of_range=0.0),
    pd_truth_errors,
    clears=("model",),
    applies=_cfar_note,
)  # fmt: skip

RCS = Ladder(
    "rcs",
    (
        Rung("constant", "one mean RCS per aircraft", parameters={"aspect_rcs": False}),
        Rung("aspect", "the aircraft's table over aspect", parameters={"aspect_rcs": True}),
    ),
    "aspect",
    (Quantity("rcs", "m²"), _PD),
    make_cell_measure(_rcs_and_pd),
    applies=_no_rcs_table_note,
)


#: Largest absolute error of ``method="table"`` over all SNR (its contract; 2.9e-8 was measured).
TABLE_ERROR = 1e-6

#: Worst absolute errors of ``method="gram_charlier"`` by number of pulses, found by search.
GRAM_CHARLIER_ERROR = {1: 0.025, 2: 0.010, 5: 0.003, 10: 0.001, 100: 5e-5}


PD_METHOD = Hook("method of Pd", str, "name of what gives the probability of detection")


class ExactDetection(Effect[str]):
    """The exact Pd; where ``[accuracy]`` allows its error, a table is looked up instead."""

    name = "exact Pd"
    acts_on = PD_METHOD
    outside_the_proof = "it is a choice between two methods, of which one is always in use"

    def verdict(self, block: Any) -> Verdict:
        """Return whether Pd is computed exactly: needs ``detection = 'exact'``; a table may replace
        it where ``[accuracy]`` allows its error.
        """
        if block.p.detection != "exact":
            return Verdict(False, f"detection is {block.p.detection!r}")
        if block.p.cfar_reference_cells is not None:
            return Verdict(True, "with CFAR there is no other")
        if has_closed_form(block):
            return Verdict(True, "with 1 pulse and Swerling I or II it is a closed form")
        bound = {"detection_probability": TABLE_ERROR}
        return Verdict(True, "detection is 'exact'", bound)

    def build(self, block: Any) -> str:
        """Return the name of the method: `exact`."""
        return "exact"


def has_closed_form(block: Any) -> bool:
    """Return whether Pd is a single power for all targets (one pulse, Swerling I or II)."""
    return block.p.pulses_summed == 1 and _swerling_models_in_use(block) <= {1, 2}


def method_reasons(block: Any, method: str) -> list[str]:
    """Return sentences on why a radar with ``model = "auto"`` computes Pd exactly or by a table."""
    allowed = block.context.sections["accuracy"].detection_probability
    if method == "table":
        said = f"table, its error is at most {TABLE_ERROR:g} and [accuracy] allows {allowed:g}"
    elif has_closed_form(block):
        said = "exact, with 1 pulse and Swerling I or II a closed form and the cheapest"
    elif block.context.simulate_everything:
        said = "exact, the reference: everything is simulated"
    elif allowed is None:
        said = "exact, the reference: [accuracy] allows no error of Pd"
    else:
        said = (
            f"exact, the reference: a table may err by {TABLE_ERROR:g}, and of the {allowed:g} "
            f"that [accuracy] allows {block.context.tolerance['detection_probability']:.2g} is left"
        )
    # Fewer pulses err more: the entry at or below the radar's own is an upper estimate.
    error = GRAM_CHARLIER_ERROR[max(n for n in GRAM_CHARLIER_ERROR if n <= block.p.pulses_summed)]
    return [
        f"Pd: {said}",
        f"Pd: not gram_charlier: it errs by up to {error:g}, and the table by less",
    ]


def _swerling_models_in_use(block: Any) -> set[int]:
    if block.p.samples_rcs:
        return {0}
    if block.p.swerling is not None:
        return {block.p.swerling % 5}
    rosters = offered_rosters(block.context)
    if not rosters:
        return {0}
    return {craft.swerling % 5 for roster in rosters for craft in roster.aircraft}
