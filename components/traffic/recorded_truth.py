"""Whether a scene records where all aircraft are."""

from dsa_des.block.component import Context

#: The truth is recorded without being asked for where aircraft times seconds, of all runs that are
#: recorded together, are at most this: some ten thousand rows with the usual sensors.
SMALL_S = 600.0
_TABLE = "truth"


def is_truth_recorded(context: Context, targets: int) -> bool:
    """Return whether true positions are recorded: as [record] says, or by default in small runs.

    Where tables are chosen, as a study chooses those that its metrics read, that one is among them
    or it is not made.

    How often sensors look does not count: replicas whose clocks differ record the same tables.
    """
    record = context.sections.get("record")
    asked = "auto" if record is None else record.truth
    if context.recorded_tables is not None:
        return asked is not False and _TABLE in context.recorded_tables
    if asked == "auto":
        seconds = context.recorded_runs * float(context.duration_s)
        return (1 + targets) * seconds <= SMALL_S
    return bool(asked)
