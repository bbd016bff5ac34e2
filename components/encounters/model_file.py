"""Reading the published text files of encounter models, strictly.

A file has ten parts in a fixed order, each a line ``# name`` with rows of numbers below it. What
is wrong is one error that names the file, and the part, line or variable.
"""

import csv
import math
import re
from collections import Counter
from pathlib import Path

import numpy as np

from components.encounters.model import (
    CLIMB,
    SPEED,
    TURN,
    BayesNetwork,
    Bins,
    EncounterModel,
    NetworkError,
    make_network,
)
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.errors import did_you_mean, shortened_repr
from dsa_des.files.input_files import InputFileError, cache_file_reads, read_input_text

PARTS = (
    "labels_initial", "G_initial", "r_initial", "N_initial",
    "labels_transition", "G_transition", "r_transition", "N_transition",
    "boundaries", "resample_rates",
)  # fmt: skip
_NEXT, _NOW = "(t+1)", "(t)"
#: An instant behind a variable's name, however it is spaced.
_INSTANT = re.compile(r"\s*\(\s*t\s*(\+\s*1\s*)?\)$")
_MOST_BINS = 10_000
#: So many nodes must agree about the number of cases before one that does not is called wrong.
_MAJORITY = 4
#: Which largest values are too small for the usual unit, what the other is worth, and both.
_UNITS = {
    CLIMB: (100.0, 60.0, "ft/s", "ft/min"),
    TURN: (0.5, 180.0 / math.pi, "rad/s", "deg/s"),
}
_FASTEST_KT = 1000.0
_Rows = list[tuple[int, str]]


class ModelFileError(ValueError):
    """A model file cannot be used; the message names the file, and the part, line or variable."""


@cache_file_reads(8)
def read_model(path: Path) -> EncounterModel:
    """Return a text file's encounter model; ModelFileError, with part and line, if unusable."""
    try:
        text = read_input_text(path)
    except InputFileError as error:
        raise ModelFileError(f"{path}: {error}") from None
    return _ModelReader(path, text).read_whole_model()


class _ModelReader:
    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.parts = self._split_parts(text)

    def make_error(self, message: str, line: int | None = None) -> ModelFileError:
        where = f"{self.path}: " if line is None else f"{self.path}: line {line}: "
        return ModelFileError(where + message)

    def _split_parts(self, text: str) -> dict[str, tuple[int, _Rows]]:
        parts: dict[str, tuple[int, _Rows]] = {}
        rows: _Rows = []
        for number, line in enumerate(text.split("\n"), start=1):
            stripped = line.strip()
            if stripped.startswith("#"):
                name = stripped[1:].strip()
                expected = PARTS[len(parts)] if len(parts) < len(PARTS) else None
                if name != expected:
                    raise self.make_error(self._wrong_part_text(name, expected, parts), number)
                rows = []
                parts[name] = number, rows
            elif stripped:
                if not parts:
                    raise self.make_error(
                        f"the file must begin with the line '# {PARTS[0]}'", number
                    )
                rows.append((number, stripped))
        if len(parts) < len(PARTS):
            raise self.make_error(f"the file ends before its part '# {PARTS[len(parts)]}'")
        return parts

    def _wrong_part_text(
        self, name: str, expected: str | None, parts: dict[str, tuple[int, _Rows]]
    ) -> str:
        if name in parts:
            return f"the part {shortened_repr(name)} stands there twice"
        if name not in PARTS:
            return f"there is no part {shortened_repr(name)}{did_you_mean(name, PARTS)}"
        if name == "boundaries" and expected == "labels_transition":
            return (
                "its part '# labels_transition' is missing: a model of initial states alone, as "
                "that of encounters near aerodromes (terminal), is not flown"
            )
        return f"the part '{name}' stands where '{expected}' is expected"

    def read_whole_model(self) -> EncounterModel:
        labels = self.read_labels("labels_initial")
        now = self.read_labels("labels_transition")
        sources, targets = self.match_transition_variables(labels, now)
        sizes = self.read_bin_counts("r_initial", labels)
        initial = self.read_network("initial", labels, sizes, range(len(labels)))
        later = self.read_bin_counts("r_transition", now)
        for index, of in [*enumerate(sources), *targets.items()]:
            if of >= 0 and later[index] != sizes[of]:
                raise self.make_error(
                    f"r_transition: variable '{now[index]}' has {later[index]} bins, but "
                    f"'{labels[of]}' has {sizes[of]} in r_initial",
                    self.parts["r_transition"][0],
                )
        transition = self.read_network("transition", now, later, sorted(targets))
        rates = self.read_resample_rates(labels)
        notes = self.check_count_totals(initial)
        bins, taken = self.convert_to_usual_units(labels, self.read_bins(labels, sizes))
        return EncounterModel(
            self.path, initial, transition, bins, rates, sources, targets, (*notes, *taken)
        )

    # -- variables ---------------------------------------------------------------------------

    def read_labels(self, part: str) -> tuple[str, ...]:
        start, rows = self.parts[part]
        if len(rows) != 1:
            raise self.make_error(
                f"{part}: one row of names is needed, there are {len(rows)}", start
            )
        number, text = rows[0]
        cells = next(csv.reader([text], skipinitialspace=True))
        names = [re.sub(r"\s+", " ", cell.strip().strip('"')).strip() for cell in cells]
        if names and not names[-1]:
            names.pop()  # a comma at the end
        names = [_INSTANT.sub(lambda at: f"(t{'+1' if at[1] else ''})", name) for name in names]
        if not all(names) or not names:
            raise self.make_error(f"{part}: a name is empty", number)
        name, count = Counter(names).most_common(1)[0]
        if count > 1:
            raise self.make_error(f"{part}: the variable '{name}' stands there twice", number)
        return tuple(names)

    def match_transition_variables(
        self, labels: tuple[str, ...], now: tuple[str, ...]
    ) -> tuple[tuple[int, ...], dict[int, int]]:
        """Return each transition variable's initial variable (index; -1 if it is at t + 1), and a
        dictionary to it from the index of each one at t + 1.
        """
        number = self.parts["labels_transition"][1][0][0]
        sources, targets = [], {}
        for index, name in enumerate(now):
            later = name.endswith(_NEXT)
            base = name.removesuffix(_NEXT if later else _NOW).strip()
            if base not in labels:
                raise self.make_error(
                    f"labels_transition: unknown variable {shortened_repr(name)}"
                    f"{did_you_mean(base, labels)}",
                    number,
                )
            of = labels.index(base)
            sources.append(-1 if later else of)
            if later:
                targets[index] = of
        # One that does not change, and of which nothing depends, may be left out.
        for index, of in targets.items():
            if f"{labels[of]}{_NOW}" not in now:
                raise self.make_error(
                    f"labels_transition: '{now[index]}' needs '{labels[of] + _NOW}' beside it",
                    number,
                )
        if len(set(sources) - {-1}) + len(targets) != len(now):
            raise self.make_error("labels_transition: a variable stands there twice", number)
        return tuple(sources), targets

    # -- numbers -----------------------------------------------------------------------------

    def read_numbers(self, part: str, what: str = "numbers") -> FloatArray:
        """Return all numbers of a file's part; ModelFileError for one negative or not finite."""
        start, rows = self.parts[part]
        values: list[float] = []
        for number, text in rows:
            words = text.replace(",", " ").split()
            for word in words:
                value = _float_or_nan(word)
                if not (math.isfinite(value) and value >= 0.0):
                    raise self.make_error(
                        f"{part}: {shortened_repr(word)}: {what} of 0 or more", number
                    )
                values.append(value)
        if not values:
            raise self.make_error(f"{part}: holds no number: the file is cut short", start)
        return np.array(values)

    def read_bin_counts(self, part: str, labels: tuple[str, ...]) -> tuple[int, ...]:
        values = self.read_numbers(part, "must be whole numbers")
        number = self.parts[part][1][0][0]
        if len(values) != len(labels):
            raise self.make_error(
                f"{part}: {len(labels)} numbers of bins are needed, one for each variable; there "
                f"are {len(values)}",
                number,
            )
        for value, label in zip(values.tolist(), labels, strict=True):
            if value != int(value) or not 1 <= value <= _MOST_BINS:
                raise self.make_error(
                    f"{part}: variable '{label}' has {value:g} bins: must be a whole number of 1 "
                    "or more",
                    number,
                )
        return tuple(int(value) for value in values)

    def read_network(
        self, which: str, labels: tuple[str, ...], sizes: tuple[int, ...], drawn: range | list[int]
    ) -> BayesNetwork:
        arrows = self.read_arrows(f"G_{which}", labels)
        part = f"N_{which}"
        counts = self.read_numbers(part, "must be counts")
        if which == "transition":
            for index in range(len(labels)):
                if index not in drawn and arrows[:, index].any():
                    raise self.make_error(
                        f"G_transition: variable '{labels[index]}' has parents, but is not drawn: "
                        f"only variables at {_NEXT} are",
                        self.parts["G_transition"][0],
                    )
        try:
            return make_network(labels, sizes, arrows, counts, list(drawn))
        except NetworkError as error:
            raise self.make_error(f"{part}: {error}", self.parts[part][1][0][0]) from None

    def read_arrows(self, part: str, labels: tuple[str, ...]) -> IntArray:
        start, rows = self.parts[part]
        count = len(labels)
        if len(rows) != count:
            raise self.make_error(f"{part}: {count} rows are needed, there are {len(rows)}", start)
        arrows = np.zeros((count, count), dtype=np.int64)
        for index, (number, text) in enumerate(rows):
            words = text.replace(",", " ").split()
            if len(words) != count or set(words) - {"0", "1"}:
                raise self.make_error(
                    f"{part}: variable '{labels[index]}': {count} values of 0 or 1 are needed",
                    number,
                )
            arrows[index] = [int(word) for word in words]
        return arrows

    def read_bins(self, labels: tuple[str, ...], sizes: tuple[int, ...]) -> tuple[Bins, ...]:
        start, rows = self.parts["boundaries"]
        if len(rows) != len(labels):
            raise self.make_error(
                f"boundaries: {len(labels)} rows are needed, one for each variable; there are "
                f"{len(rows)}",
                start,
            )
        bins = []
        for label, size, (number, text) in zip(labels, sizes, rows, strict=True):
            if text == "*":
                bins.append(Bins(None, size))
                continue
            edges = np.array([_float_or_nan(word) for word in text.replace(",", " ").split()])
            if len(edges) != size + 1:
                raise self.make_error(
                    f"boundaries: variable '{label}' has {size} bins: {size + 1} edges are needed, "
                    f"or *; there are {len(edges)}",
                    number,
                )
            if not np.isfinite(edges).all() or (np.diff(edges) <= 0.0).any():
                raise self.make_error(
                    f"boundaries: variable '{label}': edges must be rising numbers", number
                )
            bins.append(Bins(edges, size))
        return tuple(bins)

    def convert_to_usual_units(
        self, labels: tuple[str, ...], bins: tuple[Bins, ...]
    ) -> tuple[tuple[Bins, ...], list[str]]:
        """Return bins in ft/min, deg/s, and notes on small values that must be in other units.

        A file does not say its units; no aircraft climbs and sinks so little, or turns so slowly.
        """
        found, notes = list(bins), []
        for label, (least, factor, other, usual) in _UNITS.items():
            if label not in labels or (edges := bins[labels.index(label)].edges) is None:
                continue
            most = float(np.abs(edges).max())
            if most < least:
                found[labels.index(label)] = Bins(edges * factor, len(edges) - 1)
                notes.append(
                    f"variable '{label}' is read in {other}: its values reach {most:g} only, which "
                    f"no aircraft keeps to in {usual}"
                )
        speeds = bins[labels.index(SPEED)].edges if SPEED in labels else None
        if speeds is not None and speeds.max() > _FASTEST_KT:
            notes.append(f"variable '{SPEED}' reaches {speeds.max():g} kt: is it in ft/s?")
        return tuple(found), notes

    def read_resample_rates(self, labels: tuple[str, ...]) -> FloatArray:
        rates = self.read_numbers("resample_rates", "must be probabilities")
        number = self.parts["resample_rates"][1][0][0]
        if len(rates) != len(labels):
            raise self.make_error(
                f"resample_rates: {len(labels)} are needed, one for each variable; there are "
                f"{len(rates)}",
                number,
            )
        for rate, label in zip(rates.tolist(), labels, strict=True):
            if rate > 1.0:
                raise self.make_error(
                    f"resample_rates: variable '{label}': {rate:g} must lie in [0, 1]: it is the "
                    "probability per second",
                    number,
                )
        return rates

    def check_count_totals(self, initial: BayesNetwork) -> tuple[str, ...]:
        """Return a note if variables' counts differ in sum; ModelFileError if only one does.

        All nodes are counted over the same cases. A model whose nodes do not agree at all was not
        made by counting; its columns are probabilities all the same.
        """
        totals = {node.name: math.fsum(node.count_totals) for node in initial.nodes.values()}
        (common, many), *others = Counter(totals.values()).most_common()
        if not others:
            return ()
        odd = [name for name, total in totals.items() if total != common]
        if many >= _MAJORITY and many > len(totals) - 3:
            raise self.make_error(
                f"N_initial: variable '{odd[0]}': its counts sum to {totals[odd[0]]:.15g}, those "
                f"of the other variables to {common:.15g}",
                self.parts["N_initial"][1][0][0],
            )
        return ("the counts of the initial variables sum to different numbers of cases",)


def _float_or_nan(word: str) -> float:
    try:
        return math.nan if "_" in word else float(word)
    except ValueError:
        return math.nan
