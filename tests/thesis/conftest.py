"""All items made once, without drawing."""

import pytest

from components.thesis.rows import Made
from components.thesis.table import ITEMS
from tests.optical.conftest import synthetic_aircraft

__all__ = ["results", "synthetic_aircraft"]


@pytest.fixture(scope="session")
def results() -> dict[str, Made]:
    """What became of each item, by name."""
    return {item.name: item.make() for item in ITEMS}
