"""Small FMUs for the tests of this folder."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def lag(tmp_path):
    """Build a low pass as an FMU in the test's folder."""
    import c_fmus

    return lambda *args, **options: c_fmus.lag_fmu(tmp_path, *args, **options)


@pytest.fixture(scope="session")
def reference_fmus():
    """Where the Reference FMUs lie; tests that need them are left out where they are not."""
    folder = Path(__file__).resolve().parents[4] / "shared" / "data" / "fmus"
    pytest.importorskip("fmpy", reason="needs FMPy: pip install 'dsa-des[fmi]'")
    if sys.platform != "linux" or not folder.is_dir():
        pytest.skip(f"there is no {folder}")
    return folder
