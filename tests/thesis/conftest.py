"""All items made once, without drawing."""

import pytest

from components.evidence.thesis.made import Made
from components.evidence.thesis.registry import ITEMS


@pytest.fixture(scope="session")
def results() -> dict[str, Made]:
    """What became of each item, by name."""
    return {item.name: item.make() for item in ITEMS}
