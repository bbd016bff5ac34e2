"""Makes the random scenes importable by name: pytest's importlib mode puts nothing on the path."""

import importlib.util
import sys
from pathlib import Path

_NAME = "accuracy_scenes"

_spec = importlib.util.spec_from_file_location(_NAME, Path(__file__).with_name(f"{_NAME}.py"))
assert _spec is not None and _spec.loader is not None
_module = importlib.util.module_from_spec(_spec)
sys.modules[_NAME] = _module
_spec.loader.exec_module(_module)
