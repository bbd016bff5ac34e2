"""How many rows have which verdict, counted from the rows."""

from collections.abc import Sequence

from components.thesis.row import VERDICTS, Row


def tally(rows: Sequence[Row], mark: str = "") -> str:
    """Return one line: how many rows there are by verdict, and which are agreement.

    Parameters
    ----------
    rows : list of Row
    mark : str
        What stands before and after a verdict, an asterisk on a page.
    """
    verdicts = [row.verdict for row in rows]
    counts = ", ".join(f"{verdicts.count(name)} {mark}{name}{mark}" for name in VERDICTS)
    agree = [row.quantity for row in rows if row.counts]
    which = f": {'; '.join(agree)}" if agree else ""
    tried = sum(row.predicts for row in rows)
    return (
        f"{len(rows)} rows: {counts}. Only a prediction counts as agreement: of {tried} printed "
        f"numbers that are predicted, {len(agree)} agree{which}."
    )
