"""JSON that every reader takes: numbers that are none are written as null, not as ``NaN``."""

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(content: Any, *, digits: int = 17, **options: Any) -> str:
    """Return JSON text, floats rounded to `digits` significant digits, NaN and infinities null."""
    return json.dumps(_json_value(content, digits), allow_nan=False, **options)


def _json_value(value: Any, digits: int) -> Any:
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return value if digits == 17 else float(f"{value:.{digits}g}")
    if isinstance(value, Mapping):
        return {key: _json_value(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item, digits) for item in value]
    return value
