"""The silhouette of capsule and plate together, against counting and against closed cases."""

import numpy as np
import pytest
from scipy.integrate import quad

from components.optical.silhouette import PLATE_ASPECT_RATIO, visible_area

AIRCRAFT = {
    "Beech 99": (12.0, 30.0, 90.0),
    "F-16": (7.0, 20.0, 250.0),
    "B787": (90.0, 250.0, 400.0),
}


def sizes(front, side, horizontal):
    return {"front_m2": front, "side_m2": side, "horizontal_m2": horizontal}


def union_by_strips(u, front, side, horizontal, strips=4001):
    """Measure the union in the image plane: strip by strip, both bodies as plain shapes."""
    radius = np.sqrt(front / np.pi)
    half_length = side / (4.0 * radius)
    half_span = 0.5 * np.sqrt(horizontal * PLATE_ASPECT_RATIO)
    half_chord = 0.5 * np.sqrt(horizontal / PLATE_ASPECT_RATIO)
    helper = np.eye(3)[np.argmin(np.abs(u))]
    right = np.cross(u, helper)
    right /= np.linalg.norm(right)
    up = np.cross(right, u)
    nose = half_length * np.array([right[0], up[0]])
    corners = (
        np.array(
            [
                [sx * half_chord, sy * half_span, 0.0]
                for sx, sy in ((1, 1), (1, -1), (-1, -1), (-1, 1))
            ]
        )
        @ np.array([right, up]).T
    )
    reach = max(np.abs(corners[:, 1]).max(), abs(nose[1]) + radius)
    edges = np.linspace(-reach, reach, strips + 1)
    heights = 0.5 * (edges[1:] + edges[:-1])
    total = 0.0
    for y in heights:
        spans = []
        # Capsule: discs along a segment, so the widest disc chord among those near this height.
        along = np.linspace(-1.0, 1.0, 801)
        gap = radius**2 - (y - along * nose[1]) ** 2
        if np.any(gap > 0.0):
            chord = np.sqrt(np.maximum(gap, 0.0))
            inside = gap > 0.0
            centre = along * nose[0]
            spans.append(((centre - chord)[inside].min(), (centre + chord)[inside].max()))
        crossings = []
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if (a[1] - y) * (b[1] - y) < 0.0:
                crossings.append(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        if len(crossings) == 2:
            spans.append((min(crossings), max(crossings)))
        spans.sort()
        if len(spans) == 2 and spans[1][0] < spans[0][1]:
            spans = [(spans[0][0], max(spans[0][1], spans[1][1]))]
        total += sum(end - start for start, end in spans)
    return total * 2.0 * reach / strips


@pytest.mark.parametrize("name", AIRCRAFT)
@pytest.mark.parametrize(
    "view",
    [
        (0.4, 0.0, 0.0, -0.9),
        (2.2, 0.3, -0.5, 0.2),
        (1.4, -0.1, 0.05, 0.08),
        (3.0, 0.05, 0.7, -0.3),
    ],
)
def test_agrees_with_measuring_the_image(name, view):
    from components.optical.silhouette import line_of_sight_in_target_axes

    u = np.array([a[0] for a in line_of_sight_in_target_axes(*(np.array([v]) for v in view))[:3]])
    area = visible_area(*view, **sizes(*AIRCRAFT[name]), model="convex_hull")
    measured = union_by_strips(u, *AIRCRAFT[name], strips=601)
    assert area == pytest.approx(measured, rel=1.5e-3)


@pytest.mark.parametrize("name", AIRCRAFT)
def test_overlap_by_shadows_on_the_plate(name):
    # Shadows along u on the plate's own plane: the sphere's is the conic |p|² - (p·u)² <= r².
    front, side, horizontal = AIRCRAFT[name]
    radius = np.sqrt(front / np.pi)
    half_length = side / (4.0 * radius)
    half_span = 0.5 * np.sqrt(horizontal * PLATE_ASPECT_RATIO)
    half_chord = 0.5 * np.sqrt(horizontal / PLATE_ASPECT_RATIO)
    # sin(q) spacing softens the conic's square-root ends.
    grid = (np.arange(200_000) + 0.5) / 100_000 - 1.0
    for heading, elevation in ((0.3, 0.2), (1.1, 0.7), (2.5, -0.05), (2.9, 1.3), (1.5, 0.01)):
        u = np.array(
            [
                np.cos(elevation) * np.cos(heading),
                -np.cos(elevation) * np.sin(heading),
                -np.sin(elevation),
            ]
        )
        a = 1.0 - u[0] ** 2
        y_end = radius * np.sqrt(a) / abs(u[2])
        q_end = np.arcsin(min(1.0, half_span / y_end))
        q = q_end * grid
        y = y_end * np.sin(q)
        middle = u[0] * u[1] * y / a
        reach = np.sqrt(np.maximum(radius**2 * a - (u[2] * y) ** 2, 0.0)) / a + half_length
        both = np.minimum(middle + reach, half_chord) - np.maximum(middle - reach, -half_chord)
        across = np.maximum(both, 0.0) * np.cos(q)
        overlap = abs(u[2]) * float(across.mean()) * y_end * 2.0 * q_end
        total = visible_area(heading, 0.0, 0.0, elevation, **sizes(front, side, horizontal))
        union = visible_area(
            heading, 0.0, 0.0, elevation, **sizes(front, side, horizontal), model="convex_hull"
        )
        assert total - union == pytest.approx(overlap, rel=1e-8)


def test_from_above_is_a_stadium_over_a_rectangle():
    front, side, horizontal = AIRCRAFT["Beech 99"]
    radius, length = np.sqrt(front / np.pi), side / (2.0 * np.sqrt(front / np.pi))
    span = np.sqrt(horizontal * PLATE_ASPECT_RATIO)
    chord = horizontal / span
    assert chord < length and span > 2 * radius
    expected = front + side + horizontal - 2.0 * radius * chord
    for elevation in (-np.pi / 2, np.pi / 2):
        area = visible_area(
            0.3, 0.0, 0.0, elevation, **sizes(front, side, horizontal), model="convex_hull"
        )
        assert area == pytest.approx(expected, rel=1e-14)


def test_plate_at_a_slant_along_the_span_by_quadrature():
    # Line of sight in the y-z plane: u_x = 0, the capsule is a stadium and the plate a rectangle
    # of span·sin(elevation); the overlap is one smooth integral over the stadium's height.
    front, side, horizontal = 30.0, 25.0, 60.0
    radius = np.sqrt(front / np.pi)
    half_length = side / (4.0 * radius)
    half_span = 0.5 * np.sqrt(horizontal * PLATE_ASPECT_RATIO)
    half_chord = 0.5 * np.sqrt(horizontal / PLATE_ASPECT_RATIO)
    for elevation in (0.05, 0.2, 0.6, 1.2):
        top = min(radius, half_span * np.sin(elevation))
        kink = np.sqrt(radius**2 - (half_chord - half_length) ** 2)
        overlap, _ = quad(
            lambda y: 2.0 * min(half_chord, half_length + np.sqrt(radius**2 - y * y)),
            -top,
            top,
            epsabs=1e-12,
            limit=200,
            points=[-kink, kink] if kink < top else None,
        )
        area = visible_area(
            np.pi / 2, 0.0, 0.0, elevation, **sizes(front, side, horizontal), model="convex_hull"
        )
        assert area == pytest.approx(
            front + side + horizontal * np.sin(elevation) - overlap, abs=1e-9
        )


@pytest.mark.parametrize(
    ("name", "low", "high"), [("Beech 99", 17, 19), ("B787", 17, 19), ("F-16", 12, 15)]
)
def test_mean_gap_to_the_sum(name, low, high):
    # The limits are what this gave, rounded outwards; that single views are right is known from
    # the image, the shadows and the quadrature above.
    count = 4000
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    heading = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    view = (heading, 0.0, 0.0, np.arcsin(height))
    total = visible_area(*view, **sizes(*AIRCRAFT[name]), model="exact")
    union = visible_area(*view, **sizes(*AIRCRAFT[name]), model="convex_hull")
    assert np.all(union <= total) and np.all(union >= 0.5 * total)
    assert low <= 100.0 * (1.0 - union.mean() / total.mean()) <= high


def test_degenerate_bodies():
    view = (0.7, 0.1, 0.2, -0.4)
    for parts in (
        (0.0, 30.0, 90.0),
        (12.0, 30.0, 0.0),
        (0.0, 0.0, 90.0),
        (12.0, 0.0, 0.0),
        (0.0,) * 3,
    ):
        union = visible_area(*view, **sizes(*parts), model="convex_hull")
        assert union == pytest.approx(visible_area(*view, **sizes(*parts)))
    # A plate inside the sphere's outline adds nothing.
    union = visible_area(*view, **sizes(12.0, 30.0, 0.5), model="convex_hull")
    assert union == pytest.approx(visible_area(*view, **sizes(12.0, 30.0, 0.0)), rel=1e-12)


def test_edge_on_plate_is_continuous():
    tilt = np.array([0.0, 1e-300, 1e-19, 1e-17, 1e-12, 1e-8])
    area = visible_area(0.6, 0.0, 0.0, tilt, **sizes(12.0, 30.0, 90.0), model="convex_hull")
    np.testing.assert_allclose(area, area[0], atol=2e-6)
