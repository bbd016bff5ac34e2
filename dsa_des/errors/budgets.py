"""How much work is ever begun: endless work is refused beforehand, long work is announced.

Every command that can be asked for more than any machine does takes its limit from here.
"""

from dsa_des.errors.problems import UsageError

#: Scans of a run: at a microsecond each, the fewest that anything takes, eleven days.
MOST_SCANS = 1e12
#: Scans of all runs of a study: eleven days of a thousand processors.
MOST_STUDY_SCANS = 1e15
#: Runs and cells of a study.
MOST_RUNS, MOST_CELLS = 100_000_000, 1_000_000
#: Of one command that runs in one process: eleven days, and a terabyte.
MOST_SECONDS, MOST_BYTES = 1e6, 1e12
#: Samples of flights that are held in memory at once; some ten gigabytes.
MOST_SAMPLES = 200_000_000
#: Longer or larger work is announced before it begins.
LONG_SECONDS, LARGE_BYTES = 60.0, 1e9

_UNITS = ((86_400.0, "days"), (3600.0, "hours"), (60.0, "minutes"), (0.0, "seconds"))
_SIZES = ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (0.0, "kB"))


def describe_long_work(asked: str, many: int, seconds_each: float, bytes_each: float) -> str:
    """Return a sentence on work's time and bytes, empty if little; UsageError if too much.

    Parameters
    ----------
    asked : str
        What makes the work, as the user wrote it: ``--count 1000 --duration-s 86400``.
    many : int
        Pieces of work.
    seconds_each, bytes_each : float
        Processor time of a piece, and what it adds to a file.

    Raises
    ------
    UsageError
        If it would take longer, or write more, than is ever begun; with how many pieces may.
    """
    seconds, size = many * seconds_each, many * bytes_each
    said = (
        f"{asked}: about {_format_in_unit(seconds, _UNITS)} of a processor "
        f"and {_format_in_unit(size, _SIZES)}"
    )
    if seconds > MOST_SECONDS or size > MOST_BYTES:
        share = min(MOST_SECONDS / seconds, MOST_BYTES / size)
        raise UsageError(
            f"{said}; at most {_format_in_unit(MOST_SECONDS, _UNITS)} "
            f"and {_format_in_unit(MOST_BYTES, _SIZES)} are begun, "
            f"which a share of {share:.2g} of it would take"
        )
    return said if seconds > LONG_SECONDS or size > LARGE_BYTES else ""


def check_sample_count(asked: str, samples: float) -> None:
    """Raise UsageError if a piece of work would make more samples of flights than are allowed."""
    if samples > MOST_SAMPLES:
        raise UsageError(
            f"{asked}: makes {samples:.3g} samples of flights; at most {MOST_SAMPLES:,} are allowed"
        )


def _format_in_unit(value: float, units: tuple[tuple[float, str], ...]) -> str:
    size, unit = next((size, unit) for size, unit in units if value >= size)
    return f"{value / (size or (1e3 if unit == 'kB' else 1.0)):.3g} {unit}"
