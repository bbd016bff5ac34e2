"""Everything that a tracker decides by, as numbers."""

from dataclasses import dataclass
from typing import Any, Literal

from components.messages.reach import Reach
from components.tracking.filter_bank import FilterBank
from components.tracking.lasting_errors import LastingErrors
from components.tracking.life import LifeRules

Association = Literal["nearest", "gnn", "jpda"]


@dataclass(frozen=True)
class TrackerRules:
    """Everything that a tracker decides by, as numbers.

    Parameters
    ----------
    bank : FilterBank
    association : {"nearest", "gnn", "jpda"}
    gate_probability, detection_probability : float
    start_gate_probability : float
        Of the gate of a confirmed track in which no other track starts.
    exact_up_to : int
        Detections in a cluster up to which JPDA is exact.
    life : LifeRules
    start_score : float
        Logarithm of the odds that a first detection is of a target.
    start_speed_m_s, start_acceleration_m_s2, start_turn_rad_s : float
        Standard deviations along each axis of what a first detection does not tell.
    start_range_m : (mean, standard deviation)
        What is assumed of a target that is seen without a range.
    delete_above_m : float
        Standard deviation of the position (root of the sum over axes) at which a track ends.
    delete_after_ticks : int
        Time without a detection after which a track ends.
    log_density : (4, sensors)
        Logarithm of the false alarms in a scan per unit of measured volume, by kind and sensor.
    fields : tuple of Reach or None
        Where each sensor looks; None is everywhere.
    rates_of : int
        Mask of the sensors whose range rates are used.
    ticks_per_s : int
    lasting : LastingErrors or None
        What of the sensors' errors is not new at every look.
    untold_across_m2 : (sensors,)
        As in `SensorOffer`.
    """

    bank: FilterBank
    association: Association
    gate_probability: float
    start_gate_probability: float
    detection_probability: float
    exact_up_to: int
    life: LifeRules
    start_score: float
    start_speed_m_s: float
    start_acceleration_m_s2: float
    start_turn_rad_s: float
    start_range_m: tuple[float, float]
    delete_above_m: float
    delete_after_ticks: int
    log_density: Any
    fields: tuple[Reach | None, ...]
    rates_of: int
    ticks_per_s: int
    lasting: LastingErrors | None = None
    untold_across_m2: Any = None

    @property
    def widest_gate(self) -> float:
        """Probability of the gate outside of which a track has no say."""
        return max(self.gate_probability, self.start_gate_probability)
