"""Fields of view are drawn as their sensors are mounted."""

import math

import numpy as np

from components.display.map_view import field_of_view_text, outline_of
from components.messages.reach import Reach
from components.sensor.mounting import SensorAxes


def test_fields_of_view_are_drawn_as_they_are_mounted():
    reach = Reach((-math.radians(20), math.radians(20)), (-0.5, 0.5), 6000.0)
    true, believed = (math.radians(90), 0.0, 0.0), (0.0, 0.0, 0.0)
    beside = outline_of(math.radians(30), reach, SensorAxes(true, believed))
    expected = 6 * np.array([[math.sin(b), math.cos(b)] for b in np.radians([100, 140])])
    np.testing.assert_allclose(beside.corners_km[[0, 180]], expected, atol=1e-12)
    np.testing.assert_array_equal(beside.corners_km[181], [0.0, 0.0])
    assert field_of_view_text(reach, SensorAxes(true, believed)).startswith(
        "field of view ±20°\nround 90°,"
    )
    up = SensorAxes((0.0, math.radians(60), 0.0), believed)
    middle = outline_of(0.0, reach, up).corners_km[90]
    np.testing.assert_allclose(middle, [0.0, 3.0], atol=1e-12)
    assert "60° up" in field_of_view_text(reach, up)
