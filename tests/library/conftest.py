"""What tests of the library share."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def own() -> ModuleType:
    """A module that is imported here and that no other process can import."""
    spec = importlib.util.spec_from_file_location(
        "made_by_hand", Path(__file__).with_name("my_blocks.py")
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["made_by_hand"] = module
    spec.loader.exec_module(module)
    return module


SHORT = {"duration_s": 10}


@pytest.fixture
def short():
    """The first scene, cut to some seconds."""
    import dsa_des

    return dsa_des.load_scene("first_light").set(SHORT)
