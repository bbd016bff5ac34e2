"""All that keys of one table disagree about: pydantic stops at the first validator that says no."""

import re
from typing import Any

from pydantic import BaseModel
from pydantic_core import SchemaValidator

from dsa_des.errors import Disagreements


def all_disagreements(model: type[BaseModel], item: Any) -> list[str]:
    """Return what every validator of a whole model says of a table that one of them refused.

    Parameters
    ----------
    model : type
    item : ErrorDetails
        An error of pydantic's whose location is the model itself.

    Returns
    -------
    list of str
        The error's own text first. Nothing more where the table cannot be asked again.
    """
    found = _texts(item.get("ctx", {}).get("error")) or [item["msg"]]
    try:
        table = SchemaValidator(_of_fields(model.__pydantic_core_schema__)).validate_python(
            item["input"]
        )
    except Exception:  # a stranger's model may do anything; what was found stands
        return found
    names = set(model.model_fields)
    for validator in model.__pydantic_decorators__.model_validators.values():
        if validator.info.mode != "after":
            continue
        try:
            getattr(table, validator.cls_var_name)()
        except Exception as error:
            # What rests on keys that are refused may fail in any way; who means a key names it.
            if isinstance(error, ValueError):
                found += [text for text in _texts(error) if names & set(re.findall(r"\w+", text))]
    return list(dict.fromkeys(found))


def _texts(error: Any) -> list[str]:
    if isinstance(error, Disagreements):
        return list(error.texts)
    return [] if error is None else [str(error)]


def _of_fields(schema: Any) -> Any:
    """Return a model's schema without what is asked of it as a whole after its fields."""
    if schema["type"] == "function-after":
        return _of_fields(schema["schema"])
    if schema["type"] == "definitions":
        return {**schema, "schema": _of_fields(schema["schema"])}
    return schema
