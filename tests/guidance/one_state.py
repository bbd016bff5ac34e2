"""Guidance at one instant, as `guidance_of_many` gives it for a single state."""

from dataclasses import dataclass

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration
from components.guidance.bands import Guidance, guidance_of_many
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from components.well_clear.detection import Bounds, some_bounds


@dataclass(frozen=True)
class GuidedIntruder:
    """One intruder in the ownship's plane."""

    state: State
    alerter: Alerter
    early_level: int = 0
    bounds: Bounds | None = None


def guidance(
    kind_name: str, configuration: Configuration, own: State, intruders: list[GuidedIntruder]
) -> Guidance:
    """Return the bands of one kind at one instant, without memory."""
    alone = [
        GuidedIntruders(
            _one(i.state),
            i.alerter,
            np.array([i.early_level]),
            bounds=None if i.bounds is None else some_bounds(i.bounds, np.newaxis),
        )
        for i in intruders
    ]
    return guidance_of_many(kind_name, configuration, _one(own), alone)[0]


def _one(state: State) -> State:
    return State(*(np.asarray(part, dtype=np.float64).reshape(1) for part in state))
