"""One number of the thesis beside ours, and whether the two agree."""

import math
from dataclasses import dataclass
from typing import Any

AGREES = "agrees"
DIFFERS = "differs, because"
SILENT = "thesis gives no value"


@dataclass(frozen=True)
class Row:
    """One compared quantity.

    Whether it agrees is worked out from the numbers and never stated.

    Parameters
    ----------
    quantity : str
    ours : float
    unit : str
        Empty for a pure number.
    why : str
        One sentence: where our number comes from.
    printed : str, optional
        The thesis's number as it is printed (a decimal point for its comma); none if it has none.
    tolerance : float, optional
        Largest difference that agrees; by default half a unit of the last printed digit.
    because : str
        The reason, should the numbers differ.
    """

    quantity: str
    ours: float
    unit: str
    why: str
    printed: str | None = None
    tolerance: float | None = None
    because: str = ""

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
    def status(self) -> str:
        """Return ``agrees``, ``differs, because ...`` or ``thesis gives no value``.

        Raises
        ------
        ValueError
            If the numbers differ and no reason is given.
        """
        if self.printed is None:
            return SILENT
        difference = self.difference
        # The last bits of a subtraction must not tip a number that lies on the edge.
        if difference is not None and abs(difference) <= self.allowed * (1.0 + 1e-9):
            return AGREES
        if not self.because:
            raise ValueError(
                f"{self.quantity}: printed {self.printed}, ours {self.ours!r}, and no reason why"
            )
        return f"{DIFFERS} {self.because}"

    def as_dict(self, item: str) -> dict[str, Any]:
        """Return the row for JSON; what does not exist is None."""
        return {
            "item": item,
            "quantity": self.quantity,
            "printed": None if self.printed is None else float(self.printed),
            "ours": float(self.ours) if self.computed else None,
            "unit": self.unit,
            "difference": self.difference,
            "status": self.status,
            "why": self.why,
        }
