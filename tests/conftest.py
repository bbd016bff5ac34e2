"""What all tests share."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A machine that is busy with something else is no defect of what is tested.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def configs() -> Path:
    """The folder of the project's scenes."""
    return ROOT / "configs"
