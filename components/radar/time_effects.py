"""The time budget as an effect: what a scan leaves for each beam is the energy of a look."""

from typing import Any

from components.radar.time_parameters import LookEnergy
from dsa_des.block.effect import Effect, Verdict


class TimeBudget(Effect):
    """Energy of a look from the time that a scan leaves for each beam.

    A radar's link budget then differs with its scan rate, so replicas that differ in it have
    instances of their own.
    """

    lockstep = True
    name = "time budget"
    acts_on = "energy of a look"
    neutral = False
    outside_the_proof = "with it the link budget is that of another look"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``budget``, and say how the beams share a scan."""
        p = block.p
        if (look := p.look_energy) is not None:
            pulses = "" if look.pulses is None else f", pulses in it: {look.pulses}"
            return Verdict(
                True,
                f"budget is 'dwell': {look.beams.azimuth} x {look.beams.elevation} beams of "
                f"{look.dwell_s * 1000:.4g} ms each{pulses}",
            )
        if p.budget == "free":
            return Verdict(False, "budget is 'free'")
        beams, dwell_s = p.beams, p.stated_dwell_s
        if beams is None or dwell_s is None:
            return Verdict(False, "beams and dwell are not given, a scan takes no time")
        return Verdict(
            False,
            f"every look has the stated dwell: {beams.azimuth} x {beams.elevation} beams of "
            f"{dwell_s * 1000:.4g} ms fit into a scan",
        )

    def build(self, block: Any) -> LookEnergy:
        """Return what a look consists of."""
        look: LookEnergy = block.p.look_energy
        return look


def time_report(name: str, parameters: Any) -> dict[str, Any]:
    """Return the section of the run's summary that says what a scan's time is spent on.

    Parameters
    ----------
    name : str
        The radar's.
    parameters : TimeBudgetParameters
    """
    if (look := parameters.look_energy) is None:
        return {}
    return {
        "time_budgets": {
            name: {
                "beams": look.beams.count,
                "dwell_s": look.dwell_s,
                "pulses": look.pulses,
                "summed": look.summed,
                "gain": look.gain,
            }
        }
    }
