"""What EO and IR cameras have in common: pixels, signature, threshold (thesis §3.5.2)."""

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field

from components.optical.line_of_sight_rate import line_of_sight_rate
from components.optical.signature import confidence, pixels_covered, total_signature
from components.optical.weather_effects import Visibility
from components.sensor import Cells, Look, Sensor, SensorParameters
from dsa_des.types import FloatArray
from dsa_des.wake import Wake


class CameraParameters(SensorParameters):
    """Parameters of a camera; the pixel grid follows from field of view and pixel counts."""

    azimuth_pixels: int = Field(gt=0, description="Pixels across the field of view.")
    elevation_pixels: int = Field(gt=0, description="Pixels from its lower to its upper edge.")
    threshold: float = Field(default=1.0, description="Signature needed for a detection (eq. 19).")
    static_weight: float = Field(default=0.3, ge=0, description="Weight a of eq. 18, per pixel.")
    dynamic_weight: float = Field(default=0.0, ge=0, description="Weight b of eq. 18, s/rad.")
    silhouette: Literal["exact", "thesis", "convex_hull", "aspect_table"] = Field(
        default="exact",
        description="How the area follows from the target's attitude; 'aspect_table' takes each "
        "aircraft's silhouette_table.",
    )
    rate: Literal["exact", "thesis"] = Field(
        default="exact",
        description="How the line of sight's rate is formed: turning angle, or eq. 16-17.",
    )


class Camera(Sensor):
    """A camera: a target is detected when its signature reaches the threshold.

    E = a·Q·P + b·V with Q pixels covered, P contrast gain and V the rate of the line of sight
    (eq. 18); confidence is C = E - threshold, in the unit of the threshold (eq. 19).
    """

    Parameters = CameraParameters
    effects = (Visibility(),)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        low, high = self.reach.azimuth_rad
        width = high - low if high > low else high - low + 2.0 * math.pi
        height = self.reach.elevation_rad[1] - self.reach.elevation_rad[0]
        self.pixel_azimuth_rad = width / parameters.azimuth_pixels
        self.pixel_elevation_rad = height / parameters.elevation_pixels
        # Reports come on the pixel grid unless the scene gives a coarser one.
        if not parameters.azimuth_resolution_deg:
            self.azimuth_step_rad = self.pixel_azimuth_rad
        if not parameters.elevation_resolution_deg:
            self.elevation_step_rad = self.pixel_elevation_rad
        self._contrast_factors: list[Any] = []
        # Tick and NED angles of the last scan, one column per target; NaN where it saw none.
        self._last_look: tuple[int, FloatArray, FloatArray] | None = None

    def setup(self) -> None:
        """Take what the scene's effects do to the contrast."""
        self._contrast_factors = self.built("contrast")

    def area(self, cells: Cells) -> FloatArray:
        """Return the area that shows in each cell, m²."""
        raise TypeError(f"{type(self).__name__} has no area(cells)")

    def contrast(self, cells: Cells) -> FloatArray:
        """Return the contrast gain P of each cell."""
        raise TypeError(f"{type(self).__name__} has no contrast(cells)")

    def run(self, wake: Wake) -> Any:
        """Look at every target in reach at every scan of the wake."""
        self._ticks = wake.ticks
        return super().run(wake)

    def look(self, cells: Cells) -> Look:
        """Compare every target's signature with the threshold."""
        pixels = pixels_covered(
            self.area(cells),
            cells.range_m,
            pixel_azimuth_rad=self.pixel_azimuth_rad,
            pixel_elevation_rad=self.pixel_elevation_rad,
            sensor_pixels=float(self.p.azimuth_pixels * self.p.elevation_pixels),
        )
        rate = self._rate(cells) if self.p.dynamic_weight > 0 else 0.0
        contrast = self.contrast(cells)
        for factor in self._contrast_factors:
            contrast = contrast * factor(cells)
        signature = total_signature(
            pixels,
            rate,
            contrast_gain=contrast,
            static_weight=self.p.static_weight,
            dynamic_weight=self.p.dynamic_weight,
        )
        margin = confidence(signature, self.p.threshold)
        return Look(margin >= 0.0, margin, {"pixels": pixels})

    def _rate(self, cells: Cells) -> FloatArray:
        """Return each cell's rate of the line of sight since the scan before, rad/s.

        A target's first look has none, nor has the first after a scan that did not see it.
        """
        scans, targets = len(self._ticks), len(cells.roster)
        azimuth = np.full((scans + 1, targets), np.nan)
        elevation = np.full((scans + 1, targets), np.nan)
        tick = np.concatenate(([0], self._ticks))
        if self._last_look is not None:
            tick[0], azimuth[0], elevation[0] = self._last_look
        azimuth[cells.row + 1, cells.target] = cells.azimuth_rad
        elevation[cells.row + 1, cells.target] = cells.elevation_rad
        self._last_look = (int(tick[-1]), azimuth[-1].copy(), elevation[-1].copy())
        before = azimuth[cells.row, cells.target]
        interval = (tick[1:] - tick[:-1])[cells.row] / self.context.ticks_per_s
        return line_of_sight_rate(
            cells.azimuth_rad,
            cells.elevation_rad,
            before,
            elevation[cells.row, cells.target],
            np.where(np.isnan(before), 1.0, interval),
            seen_before=~np.isnan(before),
            model=self.p.rate,
        )
