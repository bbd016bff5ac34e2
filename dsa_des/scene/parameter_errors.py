"""All that keys of one table disagree about: pydantic stops at the first validator that says no."""

import re
import typing
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import SchemaValidator

from dsa_des.block.component import Parameters, to_scene_number
from dsa_des.errors import Disagreements, Lines, Problem, did_you_mean, nearest_name
from dsa_des.scene.keys import Key, parse_key_path
from dsa_des.scene.scene_file import SceneFile


def all_validator_messages(model: type[BaseModel], item: Any) -> list[str]:
    """Return the messages of all of a model's validators on a table that one of them refused."""
    texts = _error_texts(item.get("ctx", {}).get("error")) or [item["msg"]]
    try:
        table = SchemaValidator(
            _schema_without_validators(model.__pydantic_core_schema__)
        ).validate_python(item["input"])
    except Exception:  # a foreign model may raise anything; the errors so far stand
        return texts
    return list(dict.fromkeys(texts + _validator_messages(model, table)))


def other_validator_messages(
    model: type[BaseModel], given: Mapping[str, Any], refused: set[str]
) -> list[str]:
    """Return a model's validators' messages on a table whose keys `refused` are known as wrong.

    Validators that look at one of the `refused` keys, missing or wrong, say nothing.
    """
    known = set(model.model_fields)
    refused = refused & known
    try:
        schema = _relax_fields(_schema_without_validators(model.__pydantic_core_schema__), refused)
        table = SchemaValidator(schema).validate_python(
            {key: given[key] for key in known & set(given)} | dict.fromkeys(refused)
        )
        for name in refused:
            table.__dict__.pop(name, None)
    except Exception:  # a foreign model may raise anything; the errors so far stand
        return []
    return _validator_messages(model, table)


def _validator_messages(model: type[BaseModel], table: Any) -> list[str]:
    """Return the error messages of the validators that check a model as a whole."""
    texts: list[str] = []
    names = set(model.model_fields)
    for validator in model.__pydantic_decorators__.model_validators.values():
        if validator.info.mode != "after":
            continue
        try:
            getattr(table, validator.cls_var_name)()
        except Exception as error:
            # One that reads refused keys may fail in any way; one that means a key names it.
            if isinstance(error, ValueError):
                texts += [
                    text for text in _error_texts(error) if names & set(re.findall(r"\w+", text))
                ]
    return texts


def _error_texts(error: Any) -> list[str]:
    if isinstance(error, Disagreements):
        return list(error.texts)
    return [] if error is None else [str(error)]


def _schema_without_validators(schema: Any) -> Any:
    """Return a model's pydantic core schema without its after-validators."""
    if schema["type"] == "function-after":
        return _schema_without_validators(schema["schema"])
    if schema["type"] == "definitions":
        return {**schema, "schema": _schema_without_validators(schema["schema"])}
    return schema


def _relax_fields(schema: Any, refused: set[str]) -> Any:
    """Return a model's pydantic schema in which the fields `refused` may have any value."""
    if schema["type"] == "model-fields":
        anything = {"type": "model-field", "schema": {"type": "any"}}
        return {**schema, "fields": schema["fields"] | dict.fromkeys(refused, anything)}
    return {**schema, "schema": _relax_fields(schema["schema"], refused)}


_MUST = "must be "


def explain_validation_error(
    scene_file: SceneFile,
    key: Key,
    what: str,
    model: Any,
    error: ValidationError,
    beside: Iterable[str] = (),
) -> list[Problem]:
    """Return the problems pydantic found in a table, one per key, with the nearest valid name.

    It stands at `key` and describes `what`, for example a block type; keys `beside` those of the
    model may have been meant too.
    """
    problems = []
    refused: set[str] = set()
    for item in error.errors(include_url=False):
        refused.update(_key_and_nearest_known_key(model, item))
        at = _path_without_union_tags(scene_file, key, item["loc"])
        if item["type"] == "extra_forbidden":
            *inside, name = map(str, item["loc"])
            instead = None if inside else getattr(model, "former", {}).get(name)
            allowed = _allowed_field_names(model, item["loc"])
            close = nearest_name(name, [*allowed, *(() if inside else beside)])
            hint = f"; {instead}" if instead else did_you_mean(name, [close] if close else allowed)
            kind = "parameter" if key else "key"
            problems.append(scene_file.problem(at, f"unknown {kind} of {what}{hint}"))
        elif length := _expected_list_length(model, item):
            given = _value_at(scene_file, at)
            problems.append(scene_file.problem(at, f"must be a list of {length} numbers", given))
        elif item["type"] == "too_short":
            least, given = item["ctx"]["min_length"], _value_at(scene_file, at)
            if not isinstance(given, list) or len(given) < least:  # else its items were refused
                problems.append(scene_file.problem(at, f"must be at least {least} values", given))
        elif item["type"].startswith("union_tag"):
            problems.append(_discriminator_problem(scene_file, at, item["ctx"]))
        elif item["type"] == "missing":
            given = [str(k) for k in item["input"]] if isinstance(item["input"], dict) else []
            close = nearest_name(str(item["loc"][-1]), given)
            hint = f" ({close!r} is given)" if close else ""
            problems.append(scene_file.problem(at, f"is required by {what} and missing{hint}"))
        elif not item["loc"] and item["type"] == "value_error":
            texts = all_validator_messages(model, item)
            problems += [_refusal_problem(scene_file, at, text, item["input"]) for text in texts]
        elif isinstance(text := str(item.get("ctx", {}).get("error")), Lines):
            problems.append(_refusal_problem(scene_file, at, text, item["input"]))
        else:
            message = item["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
            message = message.replace("Input should be", "must be", 1)
            message = message.replace(
                "a valid number, unable to parse string as a number", "a number"
            )
            message = message.replace("a valid string", "text")
            message = re.sub("a valid integer(, unable.*)?", "a whole number", message)
            message = re.sub("a valid boolean(, unable.*)?", "true or false", message)
            message = re.sub(r"a valid dictionary.*", "a table", message)
            message = re.sub("a valid (list|tuple)", "a list", message)
            message = re.sub("^String should have at least 1 .*", "must not be empty", message)
            if item["type"] == "literal_error":
                names = re.findall(r"'([^']*)'", item["ctx"]["expected"])
                close = nearest_name(str(item["input"]), names)
                message += f"; did you mean {close!r}?" if close else ""
            problems.append(_refusal_problem(scene_file, at, message, item["input"]))
    given = _value_at(scene_file, key)
    if refused and isinstance(given, Mapping):
        for text in other_validator_messages(model, given, refused):
            problems.append(_refusal_problem(scene_file, key, text, given))
    return _join_must_be_messages(problems)


def _key_and_nearest_known_key(model: Any, item: Any) -> list[str]:
    """Return the key that an error is about and, if that is unknown, the nearest known key."""
    if not item["loc"]:
        return []
    name = str(item["loc"][0])
    if name in model.model_fields:
        return [name]
    close = nearest_name(name, list(model.model_fields))
    return [name, close] if close else [name]


def _join_must_be_messages(problems: list[Problem]) -> list[Problem]:
    """Return the problems with those of one key that begin with ``must be`` joined by ``or``."""
    by_key: dict[tuple[str, str], Problem] = {}
    rest = []
    for problem in problems:
        first = by_key.setdefault((problem.source, problem.key), problem)
        if first is problem:
            rest.append(problem)
        elif first.message.startswith(_MUST) and problem.message.startswith(_MUST):
            more = problem.message.removeprefix(_MUST)
            merged = replace(first, message=f"{first.message} or {more}")
            rest[rest.index(first)] = by_key[problem.source, problem.key] = merged
        else:
            rest.append(problem)
    return rest


def _refusal_problem(scene_file: SceneFile, at: Key, message: str, value: Any) -> Problem:
    """Return the problem with a validator's message, on a whole table at the key its text names."""
    if not isinstance(value, Mapping):
        return scene_file.problem(at, message, _plain_value_for_message(value))
    about = re.fullmatch(r"(\w+) is (\S+): (.*)", message, re.DOTALL)
    if about and about[1] in value:
        return scene_file.problem(
            (*at, about[1]), about[3], _plain_value_for_message(value[about[1]])
        )
    return scene_file.problem(at, message)


def _discriminator_problem(scene_file: SceneFile, at: Key, context: Any) -> Problem:
    """Return the problem with the key that says which of several kinds of table this is."""
    at = (*at, context["discriminator"].strip("'"))
    if "tag" not in context:
        return scene_file.problem(at, "is required and missing")
    allowed = re.findall(r"'([^']*)'", context["expected_tags"])
    close = nearest_name(context["tag"], allowed)
    hint = f"; did you mean {close!r}?" if close else ""
    return scene_file.problem(at, f"must be one of {', '.join(allowed)}{hint}", context["tag"])


def _expected_list_length(model: Any, item: Any) -> int:
    """Return the length that a fixed-length list should have, if that is the error; else 0."""
    if item["type"] not in ("tuple_type", "missing", "too_long"):
        return 0
    *path, last = item["loc"]
    if isinstance(last, str):
        path.append(last)
    elif item["type"] != "missing":
        return 0
    for name in path:
        field = model.model_fields.get(name) if isinstance(name, str) else None
        if field is None:
            continue
        annotation = field.annotation
        if typing.get_origin(annotation) is tuple and name == path[-1]:
            items = typing.get_args(annotation)
            return 0 if items[-1] is Ellipsis else len(items)
        model = _nested_model(annotation) or model
    return 0


def _value_at(scene_file: SceneFile, key: Key) -> Any:
    value: Any = scene_file.data
    for part in key:
        value = value[part]
    return _plain_value_for_message(value)


def _plain_value_for_message(value: Any) -> Any:
    if isinstance(value, Fraction):
        return to_scene_number(value)
    return str(value) if isinstance(value, str) else value


def _path_without_union_tags(scene_file: SceneFile, key: Key, loc: tuple[str | int, ...]) -> Key:
    """Return the path `key` + `loc` without the tags that pydantic inserts for unions."""
    value = _value_at(scene_file, key)
    path: list[str | int] = list(key)
    for position, part in enumerate(loc):
        exists = (isinstance(value, Mapping) and part in value) or (
            isinstance(value, list) and isinstance(part, int) and part < len(value)
        )
        if exists:
            value = value[part]
        elif position < len(loc) - 1 or not isinstance(value, Mapping) or part in value.values():
            continue  # a tag is a value of the table that it tells apart
        path.append(part)
    return tuple(path)


def _allowed_field_names(model: Any, loc: tuple[str | int, ...]) -> list[str]:
    """Return the field names allowed in the table of `loc`'s last part; empty if not a model."""
    names = [field.alias or name for name, field in model.model_fields.items()]
    for part in loc[:-1]:
        field = model.model_fields.get(part) if isinstance(part, str) else None
        if field is not None:
            nested = _nested_model(field.annotation)
            if nested is None:
                return []
            model, names = nested, list(nested.model_fields)
    return names


def _nested_model(annotation: Any) -> Any:
    if isinstance(annotation, type) and issubclass(annotation, Parameters):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        nested = _nested_model(argument)
        if nested is not None:
            return nested
    return None


def problem_of_refusing_block(
    file: SceneFile, block: str, parameters: Parameters, text: str
) -> Problem:
    """Return the problem with a block that refused to start, at the key or file that it names.

    Texts begin with keys, ``ownship: alt_m is 2e6: ...``, or with a file that a key names.
    """
    key: Key = ("blocks", block)
    for parameter, path in parameters:
        if isinstance(path, Path) and text.startswith(f"{path}: "):
            return file.problem((*key, parameter), text)
    value: Any = file.data["blocks"][block]
    while begins := re.match(r"([\w.\[\]]+)(?:: | is \S+: )", text):
        inner = parse_key_path(value, begins[1])
        try:
            for part in inner:
                value = value[part]
        except (LookupError, TypeError):
            break
        key = (*key, *inner)
        if len(key) == 2 + len(inner) and " is " in begins[0]:  # a whole sentence of its own
            return file.problem(key, text)
        text = text[begins.end() :]
    return file.problem(key, text, *([] if isinstance(value, dict | list) else [value]))
