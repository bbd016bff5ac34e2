"""The tests of what is touched come before those of what imports it, and these before the rest."""

import pytest

from tests.run_nearest import ABOVE, OWN, REST, order_tests, room_of


@pytest.mark.parametrize(
    ("file", "room"),
    [
        ("components/radar/rain.py", "radar"),
        ("components/avoidance.py", "avoidance"),
        ("dsa_des/time/clock.py", "time"),
        ("tests/tracking/scenes/test_x.py", "tracking"),
        ("docs/make/page.py", "docs"),
        ("README.md", "README.md"),
    ],
)
def test_a_file_s_tests_lie_in_the_folder_of_its_room(file: str, room: str):
    assert room_of(file) == room


def test_tests_are_ordered_by_the_arrows_of_imports():
    near = order_tests(["components/radar/rain.py"])
    assert list(near.values()) == sorted(near.values())
    assert near["tests/radar/scenes/test_rain_echo.py"] == (OWN, 0)
    radar = "tests/radar/test_swerling_block.py"
    assert near[radar][0] == OWN
    # Optics knows no rain of radars; a scene of trackers has one of them.
    assert near["tests/tracking/test_same_bytes.py"][0] == ABOVE
    assert near["tests/time/test_clock_exactness.py"] == (REST, 0)


def test_what_a_test_uses_without_importing_it_is_found_by_its_name():
    near = order_tests(["tests/support/lab.py", "configs/sensors/do365_navigation.toml"])
    assert near["tests/radar/test_target_configs.py"][0] == OWN
