"""Whether a scene's accuracy needs the exact probability of detection or the table will do."""

from typing import Any

from components.known_targets import known_targets
from dsa_des.effects import Effect, Verdict

#: Largest absolute error of ``method="table"`` over all SNR (its contract; 2.9e-8 was measured).
TABLE_ERROR = 1e-6


class ExactDetection(Effect):
    """The exact Pd; where ``[accuracy]`` allows its error, a table is looked up instead."""

    lockstep = True
    name = "exact Pd"
    acts_on = "method of Pd"
    neutral = False

    def verdict(self, block: Any) -> Verdict:
        """Ask ``detection``; where the exact form is closed it is the cheaper one anyway."""
        if block.p.detection != "exact":
            return Verdict(False, f"detection is {block.p.detection!r}")
        if block.p.pulses == 1 and self._models(block) <= {1, 2}:
            return Verdict(True, "with 1 pulse and Swerling I or II it is a closed form")
        bound = {"detection_probability": TABLE_ERROR}
        return Verdict(True, "detection is 'exact'", bound)

    def build(self, block: Any) -> str:
        """Return the method's name."""
        return "exact"

    def _models(self, block: Any) -> set[int]:
        if block.p.fluctuation == "sampled":
            return {0}
        if block.p.swerling is not None:
            return {block.p.swerling % 5}
        rosters = known_targets(block.context)
        if not rosters:
            return {0}
        return {craft.swerling % 5 for roster in rosters for craft in roster.aircraft}
