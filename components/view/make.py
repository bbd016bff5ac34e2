"""``dsa-des view``: read a run or a recorded encounter, write the page."""

from pathlib import Path

import numpy as np

from components.view.encounter_scenes import encounter_picture
from components.view.page_text import page_text
from components.view.run_scenes import run_picture
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file, write_file
from dsa_des.files.output_names import named
from dsa_des.terminal.terminal import say


def make_view(run: str, out: str | None) -> None:
    """Write the page of a run's folder or of a ``.daa`` file.

    Raises
    ------
    UsageError
        What is named is neither, or cannot be read.
    """
    source = Path(run)
    if source.is_dir():
        try:
            with np.errstate(invalid="ignore", over="ignore"):
                page = page_text(run_picture(source))
        except (
            AttributeError,
            IndexError,
            KeyError,
            OverflowError,
            TypeError,
            ValueError,
        ) as error:
            # Any of its files may be another program's: what they lack is met anywhere.
            said = str(error)[:200]
            raise UsageError(f"{run}: its tables are not those of a run ({said})") from error
        target = source.resolve().with_name(f"{source.resolve().name}.html")
    elif source.suffix == ".daa" and source.is_file():
        page = page_text(encounter_picture(source))
        target = source.with_suffix(".html")
    elif source.exists():
        raise UsageError(f"{run}: is neither a run's folder nor a .daa file")
    else:
        raise UsageError(f"{run}: there is no such folder or file")
    if out is not None:
        target = named(out)
    check_file(target)
    try:
        write_file(target, page.encode("utf-8"))
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
    say(f"wrote {target}")
