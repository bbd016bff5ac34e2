"""``dsa-des view``: read a run or a recorded encounter, write the page."""

from pathlib import Path

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
        picture = run_picture(source)
        target = source.resolve().with_name(f"{source.resolve().name}.html")
    elif source.suffix == ".daa" and source.is_file():
        picture = encounter_picture(source)
        target = source.with_suffix(".html")
    elif source.exists():
        raise UsageError(f"{run}: is neither a run's folder nor a .daa file")
    else:
        raise UsageError(f"{run}: there is no such folder or file")
    if out is not None:
        target = named(out)
    check_file(target)
    try:
        write_file(target, page_text(picture).encode("utf-8"))
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
    say(f"wrote {target}")
