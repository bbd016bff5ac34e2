"""One number of the thesis beside ours: what ours rests on, the verdict, and what an item makes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PREDICTED, CALIBRATED, CONFIGURED = "predicted", "calibrated", "configured"
DIFFERS = "differs because"
SILENT = "no value printed"
#: Every verdict there is, in the order in which they are counted. Only the first is agreement.
VERDICTS = (PREDICTED, CALIBRATED, CONFIGURED, DIFFERS, SILENT)

_SENTENCES = {
    PREDICTED: "Predicted from {}.",
    CALIBRATED: "Set from it: {}.",
    CONFIGURED: "An input of ours: {}.",
}


@dataclass(frozen=True)
class Basis:
    """Where one of our numbers comes from (predicted, calibrated, configured), with its inputs."""

    kind: str
    #: What it was predicted from, which parameter was set from the printed number, or which input
    #: it is, in a few words.
    words: str
    #: The parameters, each as ``file:key`` of the folder ``configs`` or ``module:CONSTANT`` of this
    #: package. A calibrated or configured number moves with each of them. No parameter of a
    #: predicted number was set from the number that it is compared with.
    inputs: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """Return kind and words as one sentence."""
        return _SENTENCES[self.kind].format(self.words)


def _basis_maker(kind: str) -> Callable[..., Basis]:
    return lambda words, *inputs: Basis(kind, words, inputs)


#: The basis of a number to which nothing was fitted, from which a parameter was set, that is an
#: input of ours: of words and inputs.
predicted, calibrated, configured = map(_basis_maker, (PREDICTED, CALIBRATED, CONFIGURED))


@dataclass(frozen=True)
class Row:
    """One compared quantity, whose verdict is worked out from the numbers and never stated."""

    quantity: str
    ours: float
    #: Empty for a pure number.
    unit: str
    #: One sentence more on where our number comes from, or empty if `basis` says it all.
    why: str
    printed: str | None = None
    #: Largest difference that agrees; by default half a unit of the last printed digit.
    tolerance: float | None = None
    #: The reason, should the numbers differ.
    because: str = ""
    basis: Basis | None = None
    #: A number that the thesis does not print but that follows from what it prints, or is read off
    #: one of its figures; it is shown, and is no printed number.
    derived: str = ""
    #: The row of the same number whose prediction this one repeats; it is not counted twice.
    again: str = ""

    @property
    def has_value(self) -> bool:
        """Return whether our number is finite."""
        return math.isfinite(self.ours)

    @property
    def difference(self) -> float | None:
        """Our number less the printed one, in the row's unit."""
        if self.printed is None or not self.has_value:
            return None
        return self.ours - float(self.printed)

    @property
    def allowed_difference(self) -> float:
        """Largest difference that still agrees: the tolerance, or half the last printed digit."""
        if self.tolerance is not None:
            return self.tolerance
        decimals = len((self.printed or "").partition(".")[2])
        return 0.5 * 10.0**-decimals

    @property
    def is_within_tolerance(self) -> bool:
        """Return whether the simulated number is within tolerance of the printed one."""
        difference = self.difference
        # The last bits of a subtraction must not tip a number that lies on the edge.
        return difference is not None and abs(difference) <= self.allowed_difference * (1.0 + 1e-9)

    @property
    def verdict(self) -> str:
        """Return how our number compares with print; ValueError without basis or due reason."""
        if self.printed is None:
            return SILENT
        if self.basis is None:
            raise ValueError(f"{self.quantity}: printed {self.printed}, and no basis of ours")
        if self.is_within_tolerance:
            return self.basis.kind
        if not self.because:
            raise ValueError(
                f"{self.quantity}: printed {self.printed}, ours {self.ours!r}, and no reason why"
            )
        return DIFFERS

    @property
    def verdict_text(self) -> str:
        """Return the verdict with its reason."""
        return f"{DIFFERS} {self.because}" if self.verdict == DIFFERS else self.verdict

    @property
    def source_sentences(self) -> list[str]:
        """Return sentences on our number's source: basis, reason, and which row it repeats."""
        parts = [self.basis.sentence] if self.basis is not None else []
        if self.why:
            parts.append(self.why)
        if self.again:
            parts.append(f"Says again: {self.again}.")
        return parts

    @property
    def source_text(self) -> str:
        """Return the sentences on where our number comes from as one text."""
        return " ".join(self.source_sentences)

    @property
    def is_first_prediction(self) -> bool:
        """Return whether our number predicts a printed one that no earlier row compares."""
        predicted = self.basis is not None and self.basis.kind == PREDICTED
        return predicted and self.printed is not None and not self.again

    @property
    def is_agreeing_prediction(self) -> bool:
        """Return whether the row first predicts its printed number and agrees with it."""
        return self.is_first_prediction and self.verdict == PREDICTED

    def as_dict(self, item: str) -> dict[str, Any]:
        """Return the row for JSON; what does not exist is None."""
        return {
            "item": item,
            "quantity": self.quantity,
            "printed": None if self.printed is None else float(self.printed),
            "derived": self.derived or None,
            "ours": float(self.ours) if self.has_value else None,
            "unit": self.unit,
            "difference": self.difference,
            "verdict": self.verdict,
            "because": self.because if self.verdict == DIFFERS else None,
            "from": self.source_text,
            "inputs": " ".join(self.basis.inputs) if self.basis is not None else "",
        }


@dataclass(frozen=True)
class Printed:
    """A number of the thesis as it is printed, with a decimal point for its comma."""

    text: str
    #: Largest difference that agrees; by default half a unit of the last printed digit.
    tolerance: float | None = None
    #: Why ours differs, should it, with the number of the erratum.
    because: str = ""

    @property
    def value(self) -> float:
        """Return the printed number as a float."""
        return float(self.text)

    def compare(
        self,
        quantity: str,
        ours: float,
        unit: str,
        why: str,
        basis: Basis | None,
        *,
        tolerance: float | None = None,
        because: str = "",
        again: str = "",
    ) -> Row:
        """Return a row comparing our number with this; tolerance or reason override its own."""
        return Row(quantity, ours, unit, why, self.text,
                   self.tolerance if tolerance is None else tolerance, because or self.because,
                   basis, again=again)  # fmt: skip


#: Name → number, of one item.
Cells = Mapping[str, Printed]
#: Name → values; all of equal length.
Columns = Mapping[str, Sequence[Any] | Any]


def tally_sentence(rows: Sequence[Row], mark: str = "") -> str:
    """Return a sentence: row counts by verdict, agreeing predictions; `mark` encloses names."""
    verdicts = [row.verdict for row in rows]
    counts = ", ".join(f"{verdicts.count(name)} {mark}{name}{mark}" for name in VERDICTS)
    agree = [row.quantity for row in rows if row.is_agreeing_prediction]
    which = f": {'; '.join(agree)}" if agree else ""
    tried = sum(row.is_first_prediction for row in rows)
    return (
        f"{len(rows)} rows: {counts}. Only a prediction counts as agreement: of {tried} printed "
        f"numbers that are predicted, {len(agree)} agree{which}."
    )


@dataclass(frozen=True)
class Picture:
    """One figure, drawn into a PNG when it is asked for; its name is that of the file."""

    name: str
    caption: str
    draw: Callable[[Path], None]


@dataclass(frozen=True)
class Made:
    """The result of one item: rows, figures, and data columns by the name of their CSV file."""

    rows: list[Row]
    pictures: list[Picture] = field(default_factory=list)
    data: dict[str, Columns] = field(default_factory=dict)
    #: What a reader of the rows should know.
    note: str = ""

    @classmethod
    def with_figure(
        cls, rows: list[Row], name: str, caption: str, draw: Callable[[Path], None], data: Columns
    ) -> "Made":
        """Return a result of these rows, one figure and its data file of the same name."""
        return cls(rows, [Picture(name, caption, draw)], {name: data})
