"""The pack of a small case, made once."""

from pathlib import Path

import pytest

from tests.evidence.small_case import Made, made, write_case


@pytest.fixture(scope="session")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_case(tmp_path_factory.mktemp("case"))


@pytest.fixture(scope="session")
def pack(case: Path, tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(case, tmp_path_factory.mktemp("packs") / "first")
