"""The choice between the exact probability of detection and its table, by accuracy."""

from typing import Any

from components.aircraft.known_targets import known_targets
from dsa_des.block.effect import Effect, Verdict

#: Largest absolute error of ``method="table"`` over all SNR (its contract; 2.9e-8 was measured).
TABLE_ERROR = 1e-6

#: Worst absolute errors of ``method="gram_charlier"`` by number of pulses, found by search.
GRAM_CHARLIER_ERROR = {1: 0.025, 2: 0.010, 5: 0.003, 10: 0.001, 100: 5e-5}


class ExactDetection(Effect):
    """The exact Pd; where ``[accuracy]`` allows its error, a table is looked up instead."""

    lockstep = True
    name = "exact Pd"
    acts_on = "method of Pd"
    neutral = False
    outside_the_proof = "it is a choice between two methods, of which one is always in use"

    def verdict(self, block: Any) -> Verdict:
        """Ask ``detection``; where the exact form is closed it is the cheaper one anyway."""
        if block.p.detection != "exact":
            return Verdict(False, f"detection is {block.p.detection!r}")
        if block.p.cfar_reference_cells is not None:
            return Verdict(True, "with CFAR there is no other")
        if closed_form(block):
            return Verdict(True, "with 1 pulse and Swerling I or II it is a closed form")
        bound = {"detection_probability": TABLE_ERROR}
        return Verdict(True, "detection is 'exact'", bound)

    def build(self, block: Any) -> str:
        """Return the method's name."""
        return "exact"


def closed_form(block: Any) -> bool:
    """Say whether the exact Pd of all of a radar's targets is one power, cheaper than any rung."""
    return block.p.pulses_summed == 1 and _models(block) <= {1, 2}


def picked_method(block: Any, method: str) -> list[str]:
    """Say why a radar with ``model = "auto"`` computes Pd as it does.

    Parameters
    ----------
    block : SwerlingRadar
        After its setup.
    method : {"exact", "table"}
    """
    allowed = block.context.sections["accuracy"].detection_probability
    if method == "table":
        said = f"table, its error is at most {TABLE_ERROR:g} and [accuracy] allows {allowed:g}"
    elif closed_form(block):
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


def _models(block: Any) -> set[int]:
    if block.p.samples_rcs:
        return {0}
    if block.p.swerling is not None:
        return {block.p.swerling % 5}
    rosters = known_targets(block.context)
    if not rosters:
        return {0}
    return {craft.swerling % 5 for roster in rosters for craft in roster.aircraft}
