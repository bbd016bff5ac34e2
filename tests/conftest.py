"""What all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A machine that is busy with something else is no defect of what is tested.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")
# What runs tests in parallel sets the width of its own terminal, which our tables would obey.
os.environ.pop("COLUMNS", None)

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def configs() -> Path:
    """The folder of the project's scenes."""
    return ROOT / "configs"


def slow_tests() -> list[str]:
    """Return the lines of tests/slow.txt: files, or FILE::FUNCTION."""
    lines = (ROOT / "tests" / "slow.txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what tests/slow.txt lists."""
    slow = set(slow_tests())
    for item in items:
        file, _, rest = item.nodeid.partition("::")
        if file in slow or f"{file}::{rest.split('[')[0]}" in slow:
            item.add_marker(pytest.mark.slow)
