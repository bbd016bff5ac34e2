"""JSON that every reader takes: numbers that are none are written as null, not as ``NaN``."""

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(content: Any, **options: Any) -> str:
    """Return content as JSON text; NaN and infinities become null."""
    return json.dumps(_plain(content), allow_nan=False, **options)


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
