"""The front of the line of sight: it gives what the model behind it gives."""

from types import SimpleNamespace

import numpy as np
import pytest

from components.geometry import body_angles_of_sight_line, ellipsoid
from components.geometry.earth_models import ATTITUDE_MODELS, EARTH_MODELS, LineOfSight

OWN = SimpleNamespace(
    lat_deg=np.array([-43.5]), lon_deg=np.array([172.6]), alt_m=np.array([900.0]),
    yaw_rad=np.radians([217.0]), pitch_rad=np.radians([4.0]), roll_rad=np.radians([-25.0]),
)  # fmt: skip
OTHER = SimpleNamespace(
    lat_deg=np.array([-43.52]), lon_deg=np.array([172.57]), alt_m=np.array([1300.0])
)


@pytest.mark.parametrize("earth", EARTH_MODELS)
@pytest.mark.parametrize("attitude", ATTITUDE_MODELS)
def test_body_angles_follow_from_the_line_in_ned(earth, attitude):
    line = LineOfSight(earth, attitude)
    seen = line.from_ownship(OWN, OTHER)
    places = (OWN.lat_deg, OWN.lon_deg, OWN.alt_m, OTHER.lat_deg, OTHER.lon_deg, OTHER.alt_m)
    np.testing.assert_allclose(seen[:3], line.in_ned(*places), rtol=1e-14)
    body = body_angles_of_sight_line(
        *seen[:2], OWN.yaw_rad, OWN.pitch_rad, OWN.roll_rad, model=attitude
    )  # fmt: skip
    np.testing.assert_allclose(seen[3:], body, atol=1e-14)


def test_the_models_differ_and_the_default_is_exact():
    places = (-43.5, 172.6, 900.0, -43.52, 172.57, 1300.0)
    ranges = [float(LineOfSight(earth).in_ned(*places)[2]) for earth in EARTH_MODELS]
    assert len(set(ranges)) == len(EARTH_MODELS)
    assert float(LineOfSight().in_ned(*places)[2]) == ranges[EARTH_MODELS.index("ellipsoid")]
    assert ranges[-1] == float(ellipsoid.line_of_sight(*places)[2])


@pytest.mark.parametrize("wrong", [{"earth": "disc"}, {"attitude": "upright"}])
def test_an_unknown_model_is_refused_with_those_there_are(wrong):
    ((name, value),) = wrong.items()
    with pytest.raises(ValueError, match=f"{name} is '{value}': it must be one of '"):
        LineOfSight(**wrong)
