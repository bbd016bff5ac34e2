"""How many rows have which verdict, counted from the rows."""

from collections.abc import Sequence

from components.evidence.thesis.row import VERDICTS, Row


def tally(rows: Sequence[Row], mark: str = "") -> str:
    """Return one line: how many rows there are by verdict, and how many are agreement.

    Parameters
    ----------
    rows : list of Row
    mark : str
        What stands before and after a verdict, an asterisk on a page.
    """
    verdicts = [row.verdict for row in rows]
    counts = ", ".join(f"{verdicts.count(name)} {mark}{name}{mark}" for name in VERDICTS)
    agree = sum(row.counts for row in rows)
    tried = sum(row.predicts for row in rows)
    return (
        f"{len(rows)} rows: {counts}. Only a prediction counts as agreement: of {tried} printed "
        f"numbers that are predicted, {agree} agree."
    )
