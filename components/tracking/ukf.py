"""A tracker with an unscented Kalman filter of nearly constant velocity (``tracking.ukf``)."""

from pydantic import Field

from components.estimation.motion import ConstantVelocity
from components.estimation.unscented import SigmaPoints
from components.tracking.filter_bank import FilterBank
from components.tracking.parameters import TrackerParameters
from components.tracking.tracker import Tracker


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
    lockstep = True

    def bank(self) -> FilterBank:
        """Return the one filter."""
        sigma = SigmaPoints(self.p.alpha, self.p.beta, self.p.kappa)
        return FilterBank((ConstantVelocity(self.p.acceleration_intensity_m2_s3),), None, sigma)
