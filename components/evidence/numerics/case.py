"""A hard case of the numerics, and how its number becomes text."""

from dataclasses import dataclass

DIGITS = 12


@dataclass(frozen=True)
class NumericalCase:
    """One hard case with three results.

    Parameters
    ----------
    what : str
        The case and the quantity with its unit.
    formula : str
        The naive way.
    naive, ours, reference : float
    source : str
        Where the reference comes from.
    digits : int
        Significant digits shown. Our last digits may depend on the machine's mathematical library:
        show fewer than are exact.
    """

    what: str
    formula: str
    naive: float
    ours: float
    reference: float
    source: str
    digits: int = DIGITS

    def text(self, value: float) -> str:
        """Return a value as it is shown."""
        if value != value:
            return "NaN"
        whole = float(value).is_integer() and abs(value) < 1e15
        return str(int(value)) if whole else f"{float(value):.{self.digits}g}"
