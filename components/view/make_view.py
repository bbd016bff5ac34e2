"""``dsa-des view``: the page of a run or a recorded encounter, or of several beside each other."""

from pathlib import Path

import numpy as np

from components.display.recorded_run import hint_for_shipped_scene
from components.view.page import RunPicture, page_html, page_html_of_several
from components.view.run_picture import encounter_picture, run_picture
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file_writable, write_file
from dsa_des.files.output_names import user_path
from dsa_des.terminal.terminal import say

#: More would be too narrow to be read.
_MOST = 3


def write_view_page(runs: tuple[str, ...], out: str | None, platform: str | None) -> None:
    """Write an HTML page showing run folders or ``.daa`` files; the command ``dsa-des view``."""
    if len(runs) > _MOST:
        raise UsageError(f"{len(runs)} runs: at most {_MOST} stand beside each other")
    pictures = [_picture_of_source(Path(run), platform) for run in runs]
    if len(pictures) == 1:
        page = page_html(pictures[0])
    else:
        for run, picture in zip(runs, pictures, strict=True):
            name = Path(run).resolve().name
            if picture.title != name:
                picture.title = f"{name}: {picture.title}"
        page = page_html_of_several(pictures)
    target = _default_page_path(runs) if out is None else user_path(out)
    check_file_writable(target)
    try:
        write_file(target, page.encode("utf-8"))
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
    say(f"wrote {target}")


def _default_page_path(runs: tuple[str, ...]) -> Path:
    """Return the default path of the page: beside the first run, named after all runs."""
    paths = [Path(run) if Path(run).is_file() else Path(run).resolve() for run in runs]
    names = [path.stem if path.is_file() else path.name for path in paths]
    return paths[0].with_name(f"{'-'.join(names)}.html")


def _picture_of_source(source: Path, platform: str | None) -> RunPicture:
    if source.is_dir():
        try:
            with np.errstate(invalid="ignore", over="ignore"):
                return run_picture(source, platform)
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
            # Any of its files may be another program's: what they lack is met anywhere.
            raise UsageError(
                f"{source}: its tables are not those of a run ({str(error)[:200]})"
            ) from error
    if source.suffix == ".daa" and source.is_file():
        if platform is not None:
            raise UsageError(f"{source}: --platform: a .daa file holds flights; nobody has sensors")
        return encounter_picture(source)
    if source.exists():
        raise UsageError(f"{source}: is neither a run's folder nor a .daa file")
    raise UsageError(
        f"{source}: there is no such folder or file{hint_for_shipped_scene(str(source))}"
    )
