"""How many targets a sensor evaluated at each scan, and how many it skipped, by reason."""

import numpy as np

from components.messages.reach import CULLED, EVALUATE, HIDDEN, SKIP_REASONS, ReasonArray
from dsa_des.arrays.types import BoolArray, IntArray

# Up to so many targets, counting row by row is mostly the overhead of rows.
_FEW_COLUMNS = 8


def counted(
    reason: ReasonArray, on_roster: int, culled: IntArray | None, hides: bool
) -> tuple[IntArray, dict[str, IntArray]]:
    """Return how many targets were evaluated at each scan, and skipped by reason.

    Only where something `hides` targets are hidden ones looked for. Which of the culled ones the
    arrays hold, as absent, depends on the window that they came in: what is counted does not.
    """
    if len(reason) == 1:  # one pass instead of one for each reason
        count = np.bincount(reason[0], minlength=len(SKIP_REASONS) + 1)
        of = {code: count[code : code + 1] for code in (EVALUATE, *SKIP_REASONS.values())}
    else:
        of = {
            code: _per_row(reason == code)
            for code in (EVALUATE, *SKIP_REASONS.values())
            if hides or code != HIDDEN
        }
        of.setdefault(HIDDEN, np.zeros(len(reason), dtype=np.int64))
    skipped = {name: of[code] for name, code in SKIP_REASONS.items()}
    left_out = on_roster - reason.shape[1]
    if culled is None:
        culled = np.zeros(len(reason), dtype=np.int64) + left_out
    else:
        skipped["absent"] = skipped["absent"] + (left_out - culled)
    skipped[CULLED] = culled
    return of[EVALUATE], skipped


def _per_row(mask: BoolArray) -> IntArray:
    """Return how many are true in each row; of few columns, one at a time is ten times as fast."""
    if mask.shape[1] > _FEW_COLUMNS:
        return mask.sum(axis=1)
    total = mask[:, 0].astype(np.int64) if mask.shape[1] else np.zeros(len(mask), dtype=np.int64)
    for column in mask.T[1:]:
        total += column
    return total
