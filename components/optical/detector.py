"""A camera's threshold in its picture, and the accuracy of the centres that it finds."""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.aircraft import Aircraft, InfraredAreas, Roster
from components.aircraft.known_targets import offered_rosters
from components.arguments.checks import check_not_negative, check_positive
from components.optical.contrast import CONTRAST, visibility_transmission
from components.optical.detection import (
    FAINTEST_DEVIATIONS,
    deviations_of_exceedance,
    exceeding_probability,
)
from components.optical.infrared_area import AREA
from components.optical.signature import SIGNATURE, pixels_of_cells
from components.optical.weather_effects import infrared_band_of
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.component import Parameters

_PIXEL_VARIANCE = 1.0 / 12.0


def centroid_variance(
    pixels: FloatArray, contrast_to_noise: FloatArray, blur_pixels: float
) -> FloatArray:
    """Return the variance of a target's measured centre along one picture axis, pixels².

    sigma² = 8 pi s⁴ / N², where N is the target's whole signal over the noise of a pixel and s²
    the variance of its picture: that of the blur, of a square of as many pixels, and of a pixel,
    1/12. Thompson, Larson & Webb, Precise nanometer localization analysis for individual
    fluorescent probes, Biophysical Journal 82, 2002, eq. 14, its term for background noise. It is
    the bound of Winick, Cramér-Rao lower bounds on the performance of charge-coupled-device optical
    position estimators, JOSA A 3, 1986, for a Gaussian spot. It holds where N is well above the
    noise within the spot, N > 10 s, and the blur is half a pixel or more; a sharper spot falls
    between pixels, and a target of many pixels with sharp edges is found better than this.
    """
    covered = np.asarray(check_not_negative("pixels", pixels))
    ratio = np.asarray(check_not_negative("contrast_to_noise", contrast_to_noise))
    blur = float(check_positive("blur_pixels", blur_pixels))
    spread = blur**2 + _PIXEL_VARIANCE * covered + _PIXEL_VARIANCE
    most = _PIXEL_VARIANCE * (covered + 1.0)
    signal2 = (covered * ratio) ** 2
    least2 = 8.0 * np.pi * spread**2 / most
    variance: FloatArray = 8.0 * np.pi * spread**2 / np.maximum(signal2, least2)
    return variance


#: Of a frame, where a scene says nothing of noise: that of AFRL's flight tests at the higher
#: threshold (thesis section 2.4.1: 0.01 %, read as per frame).
FALSE_ALARMS_PER_FRAME = 1e-4
# Covers the rounding of areas, pixels and signatures many times over.
_MARGIN = 1.0 + 1e-9
_MARGIN_M = 1.0
# Effects on the contrast that only take from it.
_TAKING = ("visibility", "extinction in the band")


class CameraCalibration(Parameters):
    """One known detection range of a camera, from which noise or threshold follow."""

    range_km: float = Field(gt=0, description="Range at which Pd is known, km.")
    pd: float = Field(gt=0, lt=1, description="Probability of detection there, in one look.")
    area_m2: float | None = Field(
        default=None, gt=0, description="Area that the target shows, m²; or give the aircraft."
    )
    aircraft: Aircraft | None = Field(
        default=None, description="The aircraft, with the keys of a file in configs/aircraft."
    )
    aspect_deg: float = Field(
        default=0.0,
        ge=-180,
        le=180,
        description="From where it is seen, level and at its altitude, deg: 0 nose, 90 abeam, 180 "
        "tail.",
    )
    contrast: float | None = Field(
        default=None, gt=0, description="Contrast gain P; by default the aircraft's, or 1."
    )
    visibility_km: float | None = Field(
        default=None, gt=0, description="Visibility in which the range holds, km; none: clear air."
    )

    @model_validator(mode="after")
    def _check_one_target(self) -> Self:
        if (self.area_m2 is None) == (self.aircraft is None):
            raise ValueError("exactly one of area_m2 and aircraft must be given")
        if self.area_m2 is not None and self.aspect_deg:
            raise ValueError("aspect_deg belongs to an aircraft; area_m2 is what shows")
        return self


@dataclass(frozen=True)
class CameraDetector:
    """Threshold and noise with which a camera detects."""

    threshold: float  # Sample of a signature that is a detection
    # Standard deviation of the samples; 0 for a camera that sees signatures as they are
    noise: float
    alarm_noise: float  # That of the samples that make false alarms; the same, where it is known
    places: int  # Independent samples of noise in a frame
    false_alarms: float  # Expected in a frame


def derive_detector(camera: Any, places: int, noise_of_contrast: float) -> CameraDetector:
    """Return threshold, noise and false alarm rate, deriving those that the scene omits.

    Any two of threshold, noise, false alarms and a known range give the others.
    """
    p = camera.p
    threshold, alarms, known = p.threshold, p.false_alarms_per_frame, p.calibrate
    contrast = p.noise_equivalent_contrast
    if contrast == 0.0:  # the thesis's rule, beside which a rate of false alarms may be stated
        level = 1.0 if threshold is None else threshold
        rate = alarms or 0.0
        noise = level / threshold_deviations(rate, places) if level > 0.0 and rate > 0.0 else 1.0
        return CameraDetector(level, 0.0, noise, places, rate)
    given = sum(one is not None for one in (threshold, contrast, alarms, known))
    if given == 0 or (given == 1 and alarms is not None):
        threshold = 1.0
    if given < 2 and alarms is None:
        alarms = FALSE_ALARMS_PER_FRAME
    if alarms == 0.0 and threshold is None:
        raise ValueError(
            "false_alarms_per_frame is 0: no threshold is that high; give a rate above 0"
        )
    noise = None if contrast is None else noise_of_contrast * contrast
    if known is not None:
        signature = signature_at_calibration_range(camera, known)
        above = -deviations_of_exceedance(known.pd)
        if noise is not None:
            threshold = signature - above * noise
        elif alarms is not None:
            crossed = threshold_deviations(alarms, places)
            if not above + crossed > 0.0:
                raise ValueError(
                    f"calibrate.pd is {known.pd:g}: noise alone is detected more often, with "
                    f"{alarms:g} false alarms per frame"
                )
            noise = signature / (above + crossed)
            threshold = crossed * noise
        else:
            assert threshold is not None
            noise = (signature - threshold) / above if above else -1.0
            if noise <= 0.0:
                raise ValueError(
                    f"calibrate.pd is {known.pd:g} and the signature there is {signature:.4g}: "
                    f"with threshold {threshold:g} no noise gives that; leave threshold out, or "
                    "give a range at which the signature is "
                    f"{'above' if known.pd > 0.5 else 'below'} it"
                )
        if threshold <= 0.0:
            raise ValueError(
                f"calibrate needs a threshold of {threshold:.4g}: below 0 noise is detected "
                "everywhere; give a smaller noise_equivalent_contrast or a larger pd"
            )
    elif threshold is None:
        assert noise is not None and alarms is not None
        threshold = noise * threshold_deviations(alarms, places)
    elif noise is None:
        assert alarms is not None
        if threshold <= 0.0:  # whatever there is is seen: nothing is known of the noise
            return CameraDetector(threshold, 0.0, 1.0, places, alarms)
        noise = threshold / threshold_deviations(alarms, places)
    if noise == 0.0:
        return CameraDetector(threshold, 0.0, 1.0, places, 0.0)
    rate = places * exceeding_probability(threshold / noise)
    return CameraDetector(threshold, noise, noise, places, rate)


def threshold_deviations(false_alarms: float, places: int) -> float:
    """Return how many standard deviations the threshold lies above noise; infinite for none."""
    if false_alarms == 0.0:
        return math.inf
    if false_alarms >= 0.5 * places:
        raise ValueError(
            f"false_alarms_per_frame is {false_alarms:g}: it must be below {0.5 * places:g}, half "
            f"of the {places:,} places for them in a frame"
        )
    return deviations_of_exceedance(false_alarms / places)


class _OneLook:
    """A look's stand-in for cells: level aircraft, known range, aspect, contrast, own altitude."""

    def __init__(self, craft: Aircraft, range_m: float, aspect_rad: float) -> None:
        self.roster = Roster.from_pairs([("calibrate", craft)])
        self.range_m = np.array([range_m])
        self.relative_heading_rad = np.array([math.pi - aspect_rad])
        self.target_pitch_rad = self.target_roll_rad = self.elevation_rad = np.zeros(1)
        self.target = self.craft = np.zeros(1, dtype=np.int64)

    def __len__(self) -> int:
        return 1

    def column_at_targets(self, column: FloatArray) -> AnyArray:
        return column[self.craft]


def signature_at_calibration_range(camera: Any, known: CameraCalibration) -> float:
    """Return the signature that the target of the calibration has at its range."""
    craft = known.aircraft
    if craft is None:  # a sphere shows the same to all sides
        area_m2 = known.area_m2 or 0.0
        sphere = InfraredAreas(front_m2=area_m2, back_m2=area_m2, side_m2=0.0, horizontal_m2=0.0)
        craft = Aircraft(eo=sphere, ir=sphere)
    range_m = 1000.0 * known.range_km
    cells: Any = _OneLook(craft, range_m, math.radians(known.aspect_deg))
    pixels = pixels_of_cells(
        camera.area(cells),
        cells.range_m,
        camera.pixel_azimuth_rad,
        camera.pixel_elevation_rad,
        camera.all_pixels,
    )
    contrast = camera.contrast(cells) if known.contrast is None else np.full(1, known.contrast)
    if known.visibility_km is not None:
        if infrared_band_of(camera) is not None:
            raise ValueError(
                "calibrate.visibility_km is given and extinction_band is "
                f"{infrared_band_of(camera)!r}: "
                "that band's air is another; give the contrast that is left (calibrate.contrast)"
            )
        contrast = contrast * visibility_transmission(range_m, 1000.0 * known.visibility_km)
    signature = float(
        (camera.p.static_weight * pixels * contrast * camera.counted_signature_share(pixels))[0]
    )
    if signature <= 0.0:
        raise ValueError("calibrate: the target has no signature there, so no Pd but that of noise")
    return signature


def detection_range_bound_m(camera: Any, areas: str, contrast: str) -> float:
    """Return a range beyond which this camera detects nothing, m; infinite if unknown.

    The area shown is at most the sum of the bodies' areas and the contrast at most each target's
    own, so a target needs as many pixels at least as give the faintest signature that is ever
    detected, the threshold less `FAINTEST_DEVIATIONS` of noise (errata 10).
    Infinite where that is not so: where noise alone reaches the threshold more often than that,
    with a rate of the line of sight in the signature, with areas from a table, with effects that
    can add to area or contrast, or with targets that the camera was not told of.
    """
    rosters = offered_rosters(camera.context)
    adding = [
        effect.name
        for effect in type(camera).effects
        if effect.name in camera.context.effects
        and effect.acts_on in (AREA, CONTRAST, SIGNATURE)
        and effect.name not in _TAKING
    ]
    faintest = camera.lowest_threshold() - FAINTEST_DEVIATIONS * camera.detector.noise
    if (
        not areas
        or not rosters
        or adding
        or camera.p.silhouette in ("aspect_table", "sampled_table", "mesh")
        or faintest <= 0
    ):
        return math.inf
    roster = rosters[0]
    if len(roster) == 0:
        return 0.0
    ends = [roster.column(f"{areas}.front_m2")]
    if areas == "ir":
        ends.append(roster.column("ir.back_m2"))
    area = (
        np.max(ends, axis=0)
        + roster.column(f"{areas}.side_m2")
        + roster.column(f"{areas}.horizontal_m2")
    )
    gain = roster.column(contrast)
    seen = (gain > 0.0) & (area > 0.0) & (camera.p.static_weight > 0.0)
    if not seen.any():
        return _MARGIN_M
    fewest = camera.signal_from_signature(faintest, gain[seen])["pixels"]
    pixel = camera.pixel_azimuth_rad * camera.pixel_elevation_rad
    return math.sqrt(float(np.max(area[seen] / fewest)) / pixel) * _MARGIN + _MARGIN_M
