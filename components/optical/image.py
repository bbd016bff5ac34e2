"""The camera that sees pictures: a patch round every target, rendered and then searched."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from components.geometry import angle_between_vectors, body_to_ned, ned_to_body, unit_vector
from components.geometry import body_angles as angles_of
from components.messages.detections import EXTRAS, Detections
from components.optical.flow import find_spot, single_threaded_opencv, spot_flow
from components.optical.picture import (
    Pinhole,
    capsule_and_plate_outlines,
    grey_levels,
    patch_azimuths_elevations,
    textured_background,
    union_coverage,
)
from components.optical.sensors import ElectroOptical, ElectroOpticalParameters
from components.optical.silhouette import exact_area_of_bodies_union
from components.sensor.ladder_values import make_cell_measure
from components.sensor.look import Cells, Look, effect_values_of_cells
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.message import Column, columns

PICTURE = {
    "column_px": Column("pixels", "frame", "measured column, from the left edge of the frame"),
    "row_px": Column("pixels", "frame", "measured row, from its upper edge"),
    "true_column_px": Column("pixels", "frame", "column of the target's middle"),
    "true_row_px": Column("pixels", "frame", "its row"),
    "flow_column_px": Column("pixels", "frame", "moved so far to the right between two frames"),
    "flow_row_px": Column("pixels", "frame", "moved so far down"),
    "flow_deviation_px": Column("pixels", "frame", "standard deviation of either, as it is told"),
    "flow_rate_rad_s": Column("rad/s", "", "turn of the line of sight by the flow, in NED"),
    "snr": Column("", "", "how far it stands out, in standard deviations of the background"),
}


@dataclass(eq=False)
class PictureDetections(Detections):
    """Detections of a camera that sees pictures, with their places and flow in pixels."""

    extras: dict[str, AnyArray] = columns({**EXTRAS, **PICTURE}, value=lambda m: m.extra_columns())


class ImageParameters(ElectroOpticalParameters):
    """Parameters of a camera that renders pictures and searches them for targets."""

    silhouette: Literal[
        "exact", "thesis", "convex_hull", "aspect_table", "sampled_table", "mesh"
    ] = Field(
        default="convex_hull",
        description="Model of the area that shows, as of optical.eo; the outline is that of the "
        "bodies, drawn in that size.",
    )
    frame_interval_s: float = Field(
        default=0.04, gt=0, le=1, description="Time between the two frames of a look, s."
    )
    exposure_s: float = Field(
        default=0.002, ge=0, le=1, description="Exposure of a frame, s: what moves, blurs."
    )
    texture_contrast: float = Field(
        default=0.0, ge=0, description="Standard deviation of the background, as a contrast."
    )
    texture_pixels: float = Field(
        default=6.0, ge=1, le=1e4, description="Grain of the background's texture, pixels."
    )

    @model_validator(mode="after")
    def _has_noise(self) -> Self:
        if self.noise_equivalent_contrast == 0:
            raise ValueError("noise_equivalent_contrast is 0: a picture has noise; leave it out, "
                             "or use optical.eo")  # fmt: skip
        if self.errors == "signal":
            raise ValueError("errors is 'signal': the picture has its own errors; leave it out")
        if self.exposure_s > self.frame_interval_s:
            raise ValueError(
                f"exposure_s is {self.exposure_s:g}: at most frame_interval_s, "
                f"{self.frame_interval_s:g}"
            )
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key without effect as the background's texture is off."""
        said = super().ineffective_key_notes()
        if not self.texture_contrast:
            said += self.note_ineffective("texture_pixels", because="texture_contrast is 0")
        return said


# A patch shows at least so many pixels on each side of the target, and its side is at most that.
_BESIDE, _LARGEST = 12, 128
_CURRENT, _EARLIER = 0, 1
# Multiplies pixel numbers into keys far apart (Knuth's multiplicative hash).
_APART = np.uint64(0x9E3779B97F4A7C15)
# How many patches are kept to be shown, and the most pixels of their sides.
_KEPT, SHOWN = 1024, 48


class _View(NamedTuple):
    """Pixel positions of all cells' targets at one instant, and the ownship's attitude then."""

    column: FloatArray  # of the target's middle
    row: FloatArray
    attitude: tuple[FloatArray, FloatArray, FloatArray]  # of the ownship


def _confidence(camera: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return each target's margin above the threshold, in the threshold's unit."""
    return {"confidence": camera.look(cells).confidence}


_LADDER = Ladder(
    "picture",
    (
        Rung("range_boundary", "all inside 3 km (TECVOL, section 2.3.1)",
             "optical.range_boundary", {"range_km": 3.0}),
        Rung("projection", "a line: size, range, colour (section 2.2.2)", "optical.projection"),
        Rung("thesis", "signature of the thesis's areas", "optical.eo", {"silhouette": "thesis"}),
        Rung("signature", "signature of the union of the bodies", "optical.eo",
             {"silhouette": "convex_hull"}),
        Rung("image", "rendered, searched, its flow measured", "optical.image"),
    ),
    "image", (Quantity("confidence", "signature"),), make_cell_measure(_confidence),
    clears=("model",),
)  # fmt: skip


class ImageCamera(ElectroOptical):
    """An electro-optical camera that renders the picture round each target and searches it.

    Two frames are rendered for every look, `frame_interval_s` apart: the target's outline with
    exact coverage of pixels, its smear over the exposure, the blur, a background that stands still
    in NED, and noise. The strongest spot at the target is measured by filters of several sizes
    (`components.optical.flow`); it is a detection where it reaches the threshold, in as many
    standard deviations as `optical.eo` asks of a point. Its place is what is reported, with the
    flow of the target in pixels between the frames and its deviation; NaN below three pixels, where
    the target was not there before, and where pictures do not tell. Needs the extra ``image``.
    """

    Parameters = ImageParameters
    ladders = (_LADDER,)
    _message = PictureDetections

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        single_threaded_opencv()
        azimuth, elevation = self.reach.azimuth_rad, self.reach.elevation_rad
        width = self.pixel_azimuth_rad * parameters.azimuth_pixels
        self.pinhole = Pinhole(
            width, elevation, parameters.azimuth_pixels, parameters.elevation_pixels,
            azimuth[0] + 0.5 * width,
        )  # fmt: skip
        self._pixels, self._texture = self.stream("pixel noise"), self.stream("background")
        #: Patches of the last looks by (target, tick), eight bits a pixel: what a display shows.
        self.patches: dict[tuple[int, int], AnyArray] = {}

    def request(self, port: str) -> Any:
        """Return a request for targets at the instants of both frames."""
        return replace(super().request(port), lasts_s=self.p.frame_interval_s)

    def look(self, cells: Cells) -> Look:
        """Render two frames of every cell in the picture, search them, and return detections."""
        count = len(cells)
        fields = {name: np.full(count, np.nan) for name in PICTURE}
        confidence, pixels = np.full(count, -self.detector.threshold), np.zeros(count)
        if count:
            now, before, there = self._views_now_and_before(cells)
            outlines = self._capsule_and_plate_outlines(cells, now)
            contrast = self.contrast(cells)
            for factor in self._contrast_factors:
                contrast = contrast * effect_values_of_cells(self, factor, cells)
            fields["true_column_px"], fields["true_row_px"] = now.column, now.row
            keys = cells.roster.draw_keys_of(cells.target)
            in_frame = self.pinhole.is_in_frame(now.column, now.row)
            for cell in np.flatnonzero(in_frame).tolist():
                seen = self._measure_cell(
                    cells, cell, now, before, bool(there[cell]), [o[cell] for o in outlines],
                    float(contrast[cell]), keys[cell : cell + 1],
                )  # fmt: skip
                confidence[cell] = seen.pop("confidence")
                pixels[cell] = seen.pop("pixels")
                for name, value in seen.items():
                    fields[name][cell] = value
        return Look(confidence >= 0.0, confidence, {"pixels": pixels, **fields}, {})

    def _views_now_and_before(self, cells: Cells) -> tuple[_View, _View, Any]:
        """Return the cells' pixels now and one frame ago, and which targets were present (mask)."""
        now = self._view(cells.body_azimuth_rad, cells.body_elevation_rad, cells.own_attitude)
        count = len(cells)
        seen = cells.relative_target_fields_ahead(
            np.arange(count), np.full(count, -self.p.frame_interval_s)
        )
        then = tuple(seen[f"own_{name}_rad"] for name in ("yaw", "pitch", "roll"))
        before = self._view(seen["body_azimuth_rad"], seen["body_elevation_rad"], then)
        return now, before, seen["present"]

    def _view(self, azimuth: FloatArray, elevation: FloatArray, attitude: Any) -> _View:
        return _View(*self.pinhole.pixel(*self.axes(azimuth, elevation)), attitude)

    def _capsule_and_plate_outlines(self, cells: Cells, now: _View) -> list[FloatArray]:
        """Return capsule and plate outlines, (cells, points, 2) each, pixels from the middle."""
        columns = (cells.roster.column(f"eo.{n}_m2") for n in ("front", "side", "horizontal"))
        front, side, flat = (cells.column_at_targets(column) for column in columns)
        yaw = cells.relative_heading_rad + cells.azimuth_rad
        attitude = yaw, cells.target_pitch_rad, cells.target_roll_rad
        drawn = capsule_and_plate_outlines(
            cells.azimuth_rad, cells.elevation_rad, cells.range_m, attitude, (front, side, flat)
        )
        own = [angle[:, np.newaxis] for angle in now.attitude]

        def place(directions: FloatArray) -> FloatArray:
            body = ned_to_body(*np.moveaxis(directions, -1, 0), *own)
            return np.stack(self.pinhole.pixel(*self.axes(*angles_of(*body))), axis=-1)

        ahead = unit_vector(cells.azimuth_rad, cells.elevation_rad)
        middle = place(np.stack(ahead, axis=-1)[:, np.newaxis])
        # As large as the scene's model of the area says, in the shape of the bodies.
        union = exact_area_of_bodies_union(
            cells.relative_heading_rad, cells.target_pitch_rad, cells.target_roll_rad,
            cells.elevation_rad, front, side, flat, None,
        )  # fmt: skip
        size = np.sqrt(self.visible_area_m2(cells) / np.where(union > 0.0, union, np.inf))
        return [size[:, np.newaxis, np.newaxis] * (place(one) - middle) for one in drawn]

    def _measure_cell(
        self,
        cells: Cells,
        cell: int,
        now: _View,
        before: _View,
        there: bool,
        outlines: list[FloatArray],
        contrast: float,
        key: Any,
    ) -> dict[str, float]:
        """Return the measurement from the two frames of one cell, by column name."""
        middle = np.array([now.column[cell], now.row[cell]])
        points = np.concatenate(outlines)
        extent = float(np.nanmax(np.abs(points), initial=0.0))
        if not np.isfinite(points).all():  # it reaches behind the picture
            return {"confidence": self.all_pixels, "pixels": self.all_pixels}
        attitude = [float(angle[cell]) for angle in now.attitude]
        then = [float(angle[cell]) for angle in before.attitude]
        earlier = np.array([before.column[cell], before.row[cell]])
        moved = middle - earlier
        # So far it moves before what is behind it, which the earlier patch has to hold too.
        beside = (
            self._pixel_of_ned_vector(self._ned_vector_of_pixel(middle, attitude), then) - earlier
        )
        there = there and bool(np.isfinite([moved, beside]).all())
        smear = moved * (self.p.exposure_s / self.p.frame_interval_s) if there else np.zeros(2)
        extent += 0.5 * float(np.hypot(*smear))
        margin = _BESIDE + (min(math.ceil(np.hypot(*beside)), _BESIDE) if there else 0)
        # A target that is larger than a patch is seen in a coarser picture.
        binned = max(1, math.ceil((extent + margin) / (0.5 * _LARGEST)))
        half = max(16, math.ceil(extent / binned) + margin)
        corner = np.floor(middle / binned).astype(np.int64) - half
        scene = _Scene(cells, cell, key, half, binned, contrast, outlines, smear / binned)
        later = self._render_patch(scene, corner, middle, attitude, _CURRENT)
        pixels_y, pixels_x = np.mgrid[: 2 * half, : 2 * half] + 0.5
        at = middle / binned - corner
        sought = np.hypot(pixels_x - at[0], pixels_y - at[1]) <= max(2.0, extent / binned + 1.0)
        spread = math.sqrt((self.p.blur_pixels / binned) ** 2 + 1.0 / 12.0)
        spot = find_spot(later, sought, spread, self.pixel_noise / binned)
        self._keep_patch_picture(cells, cell, later)
        place = (np.array([spot.x, spot.y]) + corner) * binned
        answer = {
            "confidence": spot.snr * self.detector.noise - self.detector.threshold,
            "pixels": float(spot.pixels * binned**2),
            "column_px": place[0], "row_px": place[1], "snr": spot.snr,
        }  # fmt: skip
        if answer["confidence"] < 0.0 or not there or spot.pixels < 3:
            return answer
        # The earlier patch is where the same part of the sky was, by the platform's own turn.
        where = self._pixel_of_ned_vector(self._ned_vector_of_pixel(place, attitude), then)
        if not np.isfinite(where).all():
            return answer
        before_corner = np.floor(where / binned).astype(np.int64) - half
        first = self._render_patch(scene, before_corner, earlier, then, _EARLIER)
        flow = spot_flow(first, later, spot, sought, self.pixel_noise / binned)
        moved_px = (np.array(flow[:2]) + corner - before_corner) * binned
        answer["flow_deviation_px"] = flow.deviation * binned
        answer["flow_column_px"], answer["flow_row_px"] = moved_px
        if np.isfinite(moved_px).all():
            lines = (
                self._ned_vector_of_pixel(place, attitude),
                self._ned_vector_of_pixel(place - moved_px, then),
            )
            turn = float(angle_between_vectors(*lines))
            answer["flow_rate_rad_s"] = turn / self.p.frame_interval_s
        return answer

    @property
    def pixel_noise(self) -> float:
        """Standard deviation of a pixel's noise, as a contrast."""
        return float(
            self.detector.noise / (self._static_weight_or_one * math.sqrt(self.point_spread_pixels))
        )

    def _render_patch(
        self, scene: "_Scene", corner: IntArray, middle: FloatArray, attitude: Any, which: int
    ) -> FloatArray:
        """Return a square patch of a frame, contrast with noise; `corner` is in binned pixels,
        `middle` (of the target) in unbinned ones, `which` is `_CURRENT` or `_EARLIER` and keys the
        noise.

        The optics blur before anything falls on pixels: it is drawn twice as fine, and summed up.
        """
        side = 2 * scene.half
        at = 2.0 * (middle / scene.binned - corner)
        fine = union_coverage(
            [at + (2.0 / scene.binned) * outline for outline in scene.outlines],
            2 * side, 2 * side, 2.0 * scene.smear,
        )  # fmt: skip
        spread, cv2 = 2.0 * self.p.blur_pixels / scene.binned, single_threaded_opencv()
        fine = cv2.GaussianBlur(fine, (0, 0), spread, borderType=cv2.BORDER_REPLICATE)
        covered = fine.reshape(side, 2, side, 2).mean(axis=(1, 3))
        picture = scene.contrast * covered
        if self.p.texture_contrast:
            behind = self.p.texture_contrast * self._patch_texture(scene, corner, attitude)
            picture = picture + (1.0 - covered) * behind
        number = np.arange(side * side, dtype=np.uint64) * _APART
        scans = np.full(side * side, scene.cells.scan[scene.cell])
        run = np.full(side * side, scene.cells.run[scene.cell])
        now_ns = scene.cells.instant_ns[scene.cell]
        drawn = self._pixels.of_runs(run, now_ns).normal(scene.key ^ number, scans, which)
        noise = drawn.reshape(side, side)
        return np.asarray(picture + (self.pixel_noise / scene.binned) * noise)

    def _patch_texture(self, scene: "_Scene", corner: IntArray, attitude: Any) -> FloatArray:
        """Return the texture under a patch, as directions over it are linear in its pixels."""
        side = 2 * scene.half
        at = (corner + scene.half) * scene.binned
        ahead, right, down = (
            self._ned_angles_of_pixel(at + side * np.array(by), attitude)
            for by in ((0, 0), (1, 0), (0, 1))
        )
        offset: Any = (np.arange(side) + 0.5 - scene.half) * (scene.binned / side)
        azimuth, elevation = patch_azimuths_elevations(ahead, right, down, offset)
        run = int(scene.cells.run[scene.cell])

        def normal(one: IntArray, other: IntArray) -> FloatArray:
            draws = self._texture.of_runs(np.full(len(one), run))
            return draws.normal(one.astype(np.uint64), other)

        grain = self.p.texture_pixels * self.pixel_azimuth_rad
        return textured_background(normal, azimuth, elevation, grain)

    def _ned_angles_of_pixel(self, pixel: AnyArray, attitude: Any) -> FloatArray:
        x, y, z = self._ned_vector_of_pixel(pixel, attitude)
        return np.array([math.atan2(y, x), math.atan2(-z, math.hypot(x, y))])

    def _ned_vector_of_pixel(self, pixel: AnyArray, attitude: Any) -> FloatArray:
        """Return the unit vector (north, east, down) of what lies at a frame's (column, row)."""
        seen = self.axes.true_direction_in_body(*map(np.atleast_1d, self.pinhole.direction(*pixel)))
        return np.array(body_to_ned(*unit_vector(*seen), *attitude))[:, 0]

    def _pixel_of_ned_vector(self, direction: FloatArray, attitude: Any) -> FloatArray:
        """Return the frame's (column, row) at which a north-east-down vector lies."""
        body = ned_to_body(*(np.atleast_1d(one) for one in direction), *attitude)
        return np.array(self.pinhole.pixel(*self.axes(*angles_of(*body))))[:, 0]

    def _keep_patch_picture(self, cells: Cells, cell: int, picture: FloatArray) -> None:
        """Store a patch as grey levels for display; the oldest ones are removed."""
        tick = int(cells.scan_ticks[cells.row[cell]])
        self.patches[int(cells.target[cell]), tick] = grey_levels(picture, SHOWN)
        while len(self.patches) > _KEPT:
            del self.patches[next(iter(self.patches))]

    def _measure(
        self, cells: Cells, detected: IntArray, look: Look, azimuth_rad: FloatArray,
        elevation_rad: FloatArray, range_m: FloatArray,
    ) -> Any:  # fmt: skip
        """Return the measurement with the spot's direction, not the true one, and errors added."""
        column, row = (look.extras[name][detected] for name in ("column_px", "row_px"))
        seen = self.axes.true_direction_in_body(*self.pinhole.direction(column, row))
        known = np.isfinite(column)
        azimuth_rad = np.where(known, seen[0], azimuth_rad)
        elevation_rad = np.where(known, seen[1], elevation_rad)
        return super()._measure(cells, detected, look, azimuth_rad, elevation_rad, range_m)

    def _extra_columns(self, cells: Cells, look: Look) -> Mapping[str, Any]:
        """Return the picture columns recorded with each detection."""
        cued = {"cued": cells.is_cued()} if self._cue_cones else {}
        return {**look.extras, **cued}


class _Scene(NamedTuple):
    """What both frames of a cell show."""

    cells: Cells
    cell: int
    key: Any
    half: int
    binned: int
    contrast: float
    outlines: list[FloatArray]
    smear: FloatArray
