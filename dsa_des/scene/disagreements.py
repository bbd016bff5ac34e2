"""All that keys of one table disagree about: pydantic stops at the first validator that says no."""

import re
from collections.abc import Mapping
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
    return list(dict.fromkeys(found + _asked(model, table)))


def disagreements_besides(
    model: type[BaseModel], given: Mapping[str, Any], refused: set[str]
) -> list[str]:
    """Return what the other keys of a table disagree about where some are refused by themselves.

    Parameters
    ----------
    model : type
    given : dict
        The table.
    refused : set of str
        Keys that are missing or wrong. Validators that look at one of them say nothing.
    """
    known = set(model.model_fields)
    refused = refused & known
    try:
        schema = _without(_of_fields(model.__pydantic_core_schema__), refused)
        table = SchemaValidator(schema).validate_python(
            {key: given[key] for key in known & set(given)} | dict.fromkeys(refused)
        )
        for name in refused:
            table.__dict__.pop(name, None)
    except Exception:  # a stranger's model may do anything; what was found stands
        return []
    return _asked(model, table)


def _asked(model: type[BaseModel], table: Any) -> list[str]:
    """Return what the validators of a whole model say of it."""
    found: list[str] = []
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
    return found


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


def _without(schema: Any, refused: set[str]) -> Any:
    """Return a model's schema in which some fields may be anything."""
    if schema["type"] == "model-fields":
        anything = {"type": "model-field", "schema": {"type": "any"}}
        return {**schema, "fields": schema["fields"] | dict.fromkeys(refused, anything)}
    return {**schema, "schema": _without(schema["schema"], refused)}
