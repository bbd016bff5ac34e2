"""Detection: the probability that an echo, or noise alone, crosses the threshold."""

from components.radar.detection.probability import (
    METHODS,
    detection_probability,
    first_declaration_probability,
    miss_probability,
    required_snr,
)
from components.radar.detection.threshold import detection_threshold

__all__ = [
    "METHODS",
    "detection_probability",
    "detection_threshold",
    "first_declaration_probability",
    "miss_probability",
    "required_snr",
]
