"""Bodies whose silhouettes are known, for the optical tests."""

import numpy as np
import pytest

BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def make_box(size, centre=(0.0, 0.0, 0.0)):
    """Vertices and faces of a box with edges along the axes."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    return 0.5 * signs * np.asarray(size) + np.asarray(centre), BOX_FACES


def make_ellipsoid(half_axes, rings=24, sides=32):
    """Vertices and faces of an ellipsoid of latitude rings, long axis along x."""
    half_axes = np.asarray(half_axes, dtype=float)
    vertices = [[1.0, 0.0, 0.0]]
    for ring in range(1, rings):
        tilt = np.pi * ring / rings
        for side in range(sides):
            turn = 2.0 * np.pi * side / sides
            vertices.append(
                [np.cos(tilt), np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn)]
            )
    vertices.append([-1.0, 0.0, 0.0])
    last = len(vertices) - 1
    faces = []
    for side in range(sides):
        beside = (side + 1) % sides
        faces.append([0, 1 + side, 1 + beside])
        faces.append([last, last - sides + beside, last - sides + side])
        for ring in range(rings - 2):
            here, there = 1 + ring * sides, 1 + (ring + 1) * sides
            faces.append([here + side, there + side, there + beside])
            faces.append([here + side, there + beside, here + beside])
    return np.array(vertices) * half_axes, np.array(faces)


def join(*bodies):
    """One mesh of several bodies."""
    vertices, faces, count = [], [], 0
    for body_vertices, body_faces in bodies:
        vertices.append(body_vertices)
        faces.append(body_faces + count)
        count += len(body_vertices)
    return np.concatenate(vertices), np.concatenate(faces)


@pytest.fixture
def box():
    return make_box


@pytest.fixture
def ellipsoid():
    return make_ellipsoid


@pytest.fixture
def joined():
    return join


@pytest.fixture
def synthetic_aircraft():
    """Fuselage 14 m x 2 m, wing 16 m x 2 m, tailplane and fin, all cutting into each other."""
    return join(
        make_ellipsoid((7.0, 1.0, 1.0)),
        make_box((2.0, 16.0, 0.2), (0.5, 0.0, 0.3)),
        make_box((1.0, 6.0, 0.1), (-6.0, 0.0, -0.4)),
        make_box((1.5, 0.1, 2.0), (-6.0, 0.0, -1.4)),
    )


@pytest.fixture
def directions():
    """Unit vectors spread evenly over the sphere (Fibonacci lattice)."""

    def spread(count):
        height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
        turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
        across = np.sqrt(1.0 - height**2)
        return across * np.cos(turn), across * np.sin(turn), height

    return spread
