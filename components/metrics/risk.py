"""The risk ratio: how much of a collision risk is left, over encounters that were run twice.

Every encounter is run without avoidance (*nominal*) and with it (*mitigated*), on the same random
numbers, and has a weight that says how often it happens in the airspace. The numbers are those of
`dsa_des.results.ratio`, under the field's names.
"""

from dsa_des.results.ratio import METHODS, PairedRatio, paired_ratio, ratios_by_class

__all__ = ["METHODS", "RiskRatio", "risk_ratio", "risk_ratios_by_class"]

RiskRatio = PairedRatio
risk_ratio = paired_ratio
risk_ratios_by_class = ratios_by_class
