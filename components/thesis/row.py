"""One number of the thesis beside ours, and the verdict on the two."""

import math
from dataclasses import dataclass
from typing import Any

from components.thesis.basis import Basis

PREDICTED, CALIBRATED, CONFIGURED = "predicted", "calibrated", "configured"
DIFFERS = "differs because"
SILENT = "no value printed"
#: Every verdict there is, in the order in which they are counted. Only the first is agreement.
VERDICTS = (PREDICTED, CALIBRATED, CONFIGURED, DIFFERS, SILENT)


@dataclass(frozen=True)
class Row:
    """One compared quantity.

    Whether numbers agree is worked out from them and never stated. What an agreement is worth
    follows from where our number comes from, which a row with a printed number must say.

    Parameters
    ----------
    quantity : str
    ours : float
    unit : str
        Empty for a pure number.
    why : str
        One sentence more on where our number comes from, or empty if `basis` says it all.
    printed : str, optional
        The thesis's number as it is printed (a decimal point for its comma); none if it has none.
    tolerance : float, optional
        Largest difference that agrees; by default half a unit of the last printed digit.
    because : str
        The reason, should the numbers differ.
    basis : Basis, optional
        What our number was predicted from, set from or fed with.
    derived : str
        A number that the thesis does not print but that follows from what it prints, or is read
        off one of its figures; it is shown, and is no printed number.
    again : str
        The row of the same number whose prediction this one repeats; it is not counted twice.
    """

    quantity: str
    ours: float
    unit: str
    why: str
    printed: str | None = None
    tolerance: float | None = None
    because: str = ""
    basis: Basis | None = None
    derived: str = ""
    again: str = ""

    @property
    def computed(self) -> bool:
        """Whether we have a number at all."""
        return math.isfinite(self.ours)

    @property
    def difference(self) -> float | None:
        """Our number less the printed one, in the row's unit."""
        if self.printed is None or not self.computed:
            return None
        return self.ours - float(self.printed)

    @property
    def allowed(self) -> float:
        """Largest difference that agrees."""
        if self.tolerance is not None:
            return self.tolerance
        decimals = len((self.printed or "").partition(".")[2])
        return 0.5 * 10.0**-decimals

    @property
    def near(self) -> bool:
        """Whether our number and the printed one are within what is allowed for."""
        difference = self.difference
        # The last bits of a subtraction must not tip a number that lies on the edge.
        return difference is not None and abs(difference) <= self.allowed * (1.0 + 1e-9)

    @property
    def verdict(self) -> str:
        """Return one of `VERDICTS`.

        Raises
        ------
        ValueError
            If a row with a printed number does not say where ours comes from, or if the numbers
            differ and no reason is given.
        """
        if self.printed is None:
            return SILENT
        if self.basis is None:
            raise ValueError(f"{self.quantity}: printed {self.printed}, and no basis of ours")
        if self.near:
            return self.basis.kind
        if not self.because:
            raise ValueError(
                f"{self.quantity}: printed {self.printed}, ours {self.ours!r}, and no reason why"
            )
        return DIFFERS

    @property
    def said(self) -> str:
        """Return the verdict with its reason."""
        return f"{DIFFERS} {self.because}" if self.verdict == DIFFERS else self.verdict

    @property
    def source(self) -> str:
        """Return in a few words where our number comes from."""
        parts = [self.basis.sentence] if self.basis is not None else []
        if self.why:
            parts.append(self.why)
        if self.again:
            parts.append(f"Says again: {self.again}.")
        return " ".join(parts)

    @property
    def predicts(self) -> bool:
        """Whether this row, and no other before it, predicts a printed number."""
        predicted = self.basis is not None and self.basis.kind == PREDICTED
        return predicted and self.printed is not None and not self.again

    @property
    def counts(self) -> bool:
        """Whether it is a prediction that agrees, and no other row's."""
        return self.predicts and self.verdict == PREDICTED

    def as_dict(self, item: str) -> dict[str, Any]:
        """Return the row for JSON; what does not exist is None."""
        return {
            "item": item,
            "quantity": self.quantity,
            "printed": None if self.printed is None else float(self.printed),
            "derived": self.derived or None,
            "ours": float(self.ours) if self.computed else None,
            "unit": self.unit,
            "difference": self.difference,
            "verdict": self.verdict,
            "because": self.because if self.verdict == DIFFERS else None,
            "from": self.source,
            "inputs": " ".join(self.basis.inputs) if self.basis is not None else "",
        }
