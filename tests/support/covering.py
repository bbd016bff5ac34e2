"""Which keys of a scene a test sees the effect of; `test_every_key_is_covered` adds them up."""

from collections.abc import Callable
from typing import TypeVar

Test = TypeVar("Test", bound=Callable[..., object])

RADARS = ("radar.threshold", "radar.swerling", "radar.range_boundary")
#: Sensors that measure range.
RANGING = (*RADARS, "laser.scanning")
LINK_BUDGETS = ("radar.threshold", "radar.swerling")
CAMERAS = ("optical.eo", "optical.ir", "optical.projection")
SENSORS = (*RADARS, *CAMERAS, "optical.range_boundary", "laser.scanning", "visual.acquisition")


def covers(*keys: str, of: tuple[str, ...] = ("",)) -> Callable[[Test], Test]:
    """Say that a test fails if one of these keys had no effect, or a wrong one.

    Parameters
    ----------
    *keys : str
        As `parameter_keys.every_key` gives them.
    of : tuple of str
        Block types that each have the keys.
    """

    def mark(test: Test) -> Test:
        found = {f"{kind}.{key}" if kind else key for kind in of for key in keys}
        test.covers = getattr(test, "covers", set()) | found  # type: ignore[attr-defined]
        return test

    return mark
