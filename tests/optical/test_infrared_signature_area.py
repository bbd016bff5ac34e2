"""Front, back and plume as an infrared camera sees them."""

import numpy as np
import pytest

from components.optical.infrared_area import PLUME_SHARE_OF_BACK, infrared_area, plume_area

FIGHTER = {"front_m2": 7.0, "back_m2": 14.0, "side_m2": 14.0, "horizontal_m2": 37.16}


def test_shape_of_figure_3_11():
    # Back 1, front 1.5 (the parameters of the figure) and nothing else: eq. 21 as it stands.
    heading = np.linspace(-np.pi, np.pi, 73)
    spheres = {"front_m2": 1.5, "back_m2": 1.0, "side_m2": 0.0, "horizontal_m2": 0.0}
    for model in ("exact", "thesis"):
        area = infrared_area(heading, 0.0, 0.0, 0.0, **spheres, model=model)
        np.testing.assert_allclose(area, -0.5 * (0.5 * np.cos(heading) + 0.5) + 1.5, rtol=1e-14)
        assert area[36] == pytest.approx(1.0) and area[0] == pytest.approx(1.5)


def test_plume_grows_from_nose_to_tail_and_with_the_engine():
    heading = np.linspace(np.pi, 0.0, 19)
    plumes = {
        engine: plume_area(heading, 0.0, 0.0, 0.0, back_m2=14.0, engine=engine)
        for engine in PLUME_SHARE_OF_BACK
    }
    assert np.all(plumes["propeller"] == 0.0)
    for hot in ("turbofan", "turbojet"):
        assert plumes[hot][0] == pytest.approx(0.0, abs=1e-15)
        assert np.all(np.diff(plumes[hot]) > 0.0)
    assert np.all(plumes["turbojet"][1:] > plumes["turbofan"][1:])
    assert plumes["turbojet"][-1] == 14.0


def test_engine_adds_the_plume_and_none_is_the_thesis():
    view = (0.4, 0.1, -0.2, 0.3)
    bare = infrared_area(*view, **FIGHTER)
    hot = infrared_area(*view, **FIGHTER, engine="turbojet")
    assert hot - bare == pytest.approx(
        plume_area(*view, back_m2=FIGHTER["back_m2"], engine="turbojet")
    )
    assert infrared_area(*view, **FIGHTER, engine="propeller") == bare
    half = infrared_area(*view, **FIGHTER, engine="turbojet", plume_share_of_back=0.5)
    assert half - bare == pytest.approx(0.5 * (hot - bare))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"engine": "rocket"}, "engine is 'rocket'.*propeller, turbofan, turbojet"),
        ({"engine": "turbofan", "plume_share_of_back": -0.1}, "plume_share_of_back is -0.1"),
        ({"plume_share_of_back": 0.5}, "engine is None"),
        ({"back_m2": -1.0}, "back_m2 is -1"),
    ],
)
def test_bad_input_is_named(change, says):
    with pytest.raises(ValueError, match=says):
        infrared_area(0.0, 0.0, 0.0, 0.0, **{**FIGHTER, **change})
