"""Trackers by their filter (``tracking.ekf``, ``tracking.ukf``, ``tracking.imm``)."""

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from components.estimation.estimator import ExtendedKalmanFilter
from components.estimation.interacting_models import InteractingMultipleModels
from components.estimation.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    Motion,
)
from components.estimation.unscented import SigmaPoints, UnscentedKalmanFilter
from components.tracking.rules import TrackerParameters
from components.tracking.tracker import Tracker


class ExtendedKalman(Tracker):
    """Linearises measurements at the predicted state; motion is linear and exact.

    In the open it agrees with the unscented filter and costs a tenth. Where the spread across the
    line of sight is no longer small beside the range it is too sure of itself.
    """


class UnscentedParameters(TrackerParameters):
    """Parameters of the unscented tracker."""

    alpha: float = Field(default=1.0, gt=0, le=1, description="Spread of the sigma points.")
    beta: float = Field(
        default=2.0, ge=0, description="Weight of the middle point in covariances; 2 for Gaussians."
    )
    kappa: float = Field(default=0.0, gt=-6, description="Second spread of the sigma points.")


class Unscented(Tracker):
    """Takes the moments of measurements from sigma points instead of linearising."""

    Parameters = UnscentedParameters

    def estimator(self) -> UnscentedKalmanFilter:
        """Return an unscented filter of nearly constant velocity."""
        return UnscentedKalmanFilter(
            ConstantVelocity(self.p.acceleration_intensity_m2_s3),
            SigmaPoints(self.p.alpha, self.p.beta, self.p.kappa),
        )


Model = Literal["velocity", "turn", "acceleration"]


class InteractingParameters(TrackerParameters):
    """Parameters of the tracker with interacting models.

    The defaults are chosen on a table of turns, climbs and changes of speed (docs/tracking.md).
    """

    acceleration_intensity_m2_s3: float = Field(
        default=1.0, gt=0,
        description="Intensity of the white acceleration within `velocity`, m²/s³.",
    )  # fmt: skip
    models: tuple[Model, ...] = Field(
        default=("velocity", "turn", "acceleration"),
        min_length=2,
        max_length=3,
        description="Motion models, each once: constant velocity, coordinated turn, constant "
        "acceleration.",
    )
    transition_rates_per_s: tuple[tuple[float, ...], ...] | None = Field(
        default=None,
        description="Rates from each model (row) to each (column), 1/s; the diagonal is not read. "
        "By default each is left every 15 s, to any other alike.",
    )
    turn_acceleration_intensity_m2_s3: float = Field(
        default=1.0, gt=0, description="Intensity of the white acceleration within a turn, m²/s³."
    )
    turn_rate_intensity_deg2_s3: float = Field(
        default=0.01, gt=0, description="Intensity with which the rate of a turn drifts, deg²/s³."
    )
    jerk_intensity_m2_s5: float = Field(
        default=4.0, gt=0, description="Intensity of white jerk of `acceleration`, m²/s⁵."
    )
    start_turn_deg_s: float = Field(
        default=3.0,
        gt=0,
        description="Standard deviation of the turn rate of a new track, and of one that begins to "
        "turn, deg/s.",
    )
    start_acceleration_m_s2: float = Field(
        default=8.0,
        gt=0,
        description="That of the acceleration along each axis of a new track, and of one that "
        "begins to accelerate, m/s².",
    )

    @model_validator(mode="after")
    def _check_models_and_rates(self) -> Any:
        if len(set(self.models)) < len(self.models):
            raise ValueError(f"models = {list(self.models)} names one twice; allowed: each once")
        rates, many = self.transition_rates_per_s, len(self.models)
        if rates is not None:
            if len(rates) != many or any(len(row) != many for row in rates):
                raise ValueError(
                    f"transition_rates_per_s has other rows than models; allowed: {many} rows of "
                    f"{many} rates"
                )
            if any(v < 0 for i, row in enumerate(rates) for j, v in enumerate(row) if i != j):
                raise ValueError("transition_rates_per_s has a negative rate; allowed: 0 or more")
        return self


class InteractingModels(Tracker):
    """Runs several extended Kalman filters that share what they know by the models' odds."""

    Parameters = InteractingParameters

    def estimator(self) -> InteractingMultipleModels:
        """Return a filter for each model."""
        p = self.p
        known: dict[str, Motion] = {
            "velocity": ConstantVelocity(p.acceleration_intensity_m2_s3),
            "turn": CoordinatedTurn(
                p.turn_acceleration_intensity_m2_s3,
                float(np.radians(1.0)) ** 2 * p.turn_rate_intensity_deg2_s3,
            ),
            "acceleration": ConstantAcceleration(p.jerk_intensity_m2_s5),
        }
        rates = p.transition_rates_per_s
        if rates is None:
            others = len(p.models) - 1
            rates = ((1.0 / 15.0 / others,) * len(p.models),) * len(p.models)
        fresh = {
            "velocity": 0.0,
            "turn": float(np.radians(p.start_turn_deg_s)) ** 2,
            "acceleration": p.start_acceleration_m_s2**2,
        }
        return InteractingMultipleModels(
            tuple(ExtendedKalmanFilter(known[name]) for name in p.models), np.array(rates),
            tuple(fresh[name] for name in p.models),
        )  # fmt: skip
