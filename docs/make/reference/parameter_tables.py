"""Tables of parameters in which keys that many blocks share stand once.

A parameter belongs to the class that declares it. The parameters of a class that two places or more
use, as a base or as a table within a table, are a section of their own, which those places link.
A parameter whose row there would say something else (another default, say) stays where it is.
"""

import inspect
import re
from collections import Counter
from collections.abc import Iterable, Iterator

from pydantic import BaseModel

from dsa_des.block.parameters import nested_models
from dsa_des.commands.parameters import Row, parameter_rows

_CHANGES = " May change while a run lasts."
#: Marks keys that may change while a run lasts.
MARK = "†"

_Model = type[BaseModel]


class ParameterTables:
    """The rows of models and the sections that they share.

    Parameters
    ----------
    models : iterable of pydantic models
        All models that are shown.
    """

    def __init__(self, models: Iterable[_Model]) -> None:
        self._rows: dict[_Model, dict[str, Row]] = {}
        places: Counter[_Model] = Counter()
        shown: dict[tuple[_Model, str], Counter[Row]] = {}
        for model in models:
            for at in _walk(model):
                for name, row in self._own(at).items():
                    owner = _owner(at, name)
                    shown.setdefault((owner, name), Counter())[row] += 1
                places.update({_owner(at, name) for name in self._own(at)})
        self._usual = {key: rows.most_common(1)[0][0] for key, rows in shown.items()}
        self._shared = {model for model, number in places.items() if number > 1}

    def rows(self, model: _Model, prefix: str = "") -> list[Row]:
        """Return the rows of a model that stand in its own table."""
        found: list[Row] = []
        for name in self._own(model):
            if not self._elsewhere(model, name):
                found += self._with_inner(model, name, prefix)
        return found

    def links(self, model: _Model, section: bool = False) -> str:
        """Return links to the sections of keys that a model's table, or its section, leaves out."""
        left_out = {
            _owner(model, name) for name in self._own(model) if self._elsewhere(model, name)
        }
        bases = [base for base in model.__mro__ if base in left_out]
        return ", ".join(_link(base) for base in bases if not (section and base is model))

    def sections(self) -> Iterator[tuple[str, str, list[Row], str]]:
        """Yield title, what it is, rows, and links to other keys of every section, by title."""
        for model in sorted(self._shared, key=_title):
            rows: list[Row] = []
            for owner, name in self._usual:
                if owner is model:
                    rows += self._with_inner(model, name, "")
            doc = inspect.cleandoc(model.__doc__ or "").split("\n\n")[0].replace("\n", " ")
            yield _title(model), doc, rows, self.links(model, section=True)

    def _own(self, model: _Model) -> dict[str, Row]:
        if model not in self._rows:
            rows = [(row[0].strip(), *row[1:]) for row in parameter_rows(model)]
            self._rows[model] = {row[0]: row for row in rows if "." not in row[0]}
        return self._rows[model]

    def _elsewhere(self, model: _Model, name: str) -> bool:
        owner = _owner(model, name)
        said = self._usual.get((owner, name))
        return owner in self._shared and said == self._own(model)[name]

    def _with_inner(self, model: _Model, name: str, prefix: str) -> list[Row]:
        row = self._usual[model, name] if model in self._shared else self._own(model)[name]
        key, kind, unit, default, meaning = mark_changing(row)
        inner: list[Row] = []
        links = []
        for nested in nested_models(model.model_fields[name].annotation):
            if nested in self._shared:
                links.append(_link(nested))
            else:
                inner += self.rows(nested, f"{prefix}{name}.")
                if other := self.links(nested):
                    links.append(other)
        if links:
            meaning = f"{meaning} Keys: {', '.join(links)}.".strip()
            default = "see there" if default == "see below" else default
        return [(f"{prefix}{key}", kind, unit, default, meaning), *inner]


def mark_changing(row: Row) -> Row:
    """Return the row with a mark in place of the sentence that the key may change."""
    key, kind, unit, default, meaning = row
    if not meaning.endswith(_CHANGES):
        return row
    return f"{key} {MARK}", kind, unit, default, meaning.removesuffix(_CHANGES)


def _walk(model: _Model) -> Iterator[_Model]:
    yield model
    for info in model.model_fields.values():
        for nested in nested_models(info.annotation):
            yield from _walk(nested)


def _owner(model: _Model, name: str) -> _Model:
    return next(
        base
        for base in model.__mro__
        if issubclass(base, BaseModel) and name in inspect.get_annotations(base)
    )


def _title(model: _Model) -> str:
    words = re.findall(r"[A-Z][a-z]*", model.__name__.removesuffix("Parameters"))
    title = " ".join(words)
    return title[0] + title[1:].lower()


def _link(model: _Model) -> str:
    title = _title(model)
    return f"[{title}](#{title.lower().replace(' ', '-')})"
