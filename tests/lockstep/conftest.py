"""Running scenes in lock step and each by itself."""

from types import SimpleNamespace

import pytest
from same_runs import replicas_of, same_as_alone, tables_of


@pytest.fixture(scope="session")
def lock():
    """What is in `same_runs`."""
    return SimpleNamespace(
        tables_of=tables_of, same_as_alone=same_as_alone, replicas_of=replicas_of
    )
