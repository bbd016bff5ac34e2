"""``dsa-des examples``: list the scenes and studies that are shipped, or copy them."""

import os
from pathlib import Path

from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import unfinished
from dsa_des.files.output_names import check_place, location_of, named, reason_of
from dsa_des.scene.examples import Example, examples
from dsa_des.scene.shipped_files import folders
from dsa_des.terminal.terminal import say

_HEADINGS = {
    "scene": "Scenes: dsa-des run NAME",
    "study": "Studies: dsa-des study NAME",
}
_OPTION = "--copy"
_CODE = "__pycache__"


def show_examples(copy: str | None) -> None:
    """List all shipped scenes and studies, or copy their folders with all that they extend."""
    if copy is not None:
        _copy(named(copy, _OPTION))
        return
    found = examples()
    if not found:
        say("no installed package ships scenes or studies")
    width = max((len(example.name) for example in found), default=0)
    for kind, heading in _HEADINGS.items():
        of_kind = [example for example in found if example.kind == kind]
        if of_kind:
            say(heading)
        for example in of_kind:
            say(_line(example, width))


def _line(example: Example, width: int) -> str:
    return f"  {example.name:<{width}}  {' '.join(example.title.split())}"


def _copy(target: Path) -> None:
    """Copy the folders of all packages; several each into a folder of the package's name.

    Raises
    ------
    UsageError
        If the target is there already and not empty, or is no place for a folder.
    OutputError
        If it cannot be written.
    """
    sources = folders()
    if not sources:
        raise UsageError("no installed package ships scenes or studies")
    check_place(target, _OPTION)
    try:
        if os.path.lexists(target) and any(target.iterdir()):
            raise UsageError(f"{_OPTION} {target}: is not empty; a new folder is needed")
        place = location_of(target)
        with unfinished(place) as folder:
            copied = folder / "copy"
            copied.mkdir()
            several = len(sources) > 1
            count = sum(
                _copy_files(source, copied / source.parent.name if several else copied)
                for source in sources
            )
            if place.exists():
                place.rmdir()
            copied.rename(place)
    except OSError as error:
        raise OutputError(f"{_OPTION} {target}: cannot be written: {reason_of(error)}") from error
    say(f"{target}: {count} files")


def _copy_files(source: Path, into: Path) -> int:
    """Copy what is in the files, not who may read and write them."""
    files = [path for path in sorted(source.rglob("*")) if path.is_file()]
    files = [path for path in files if _CODE not in path.parts]
    for path in files:
        copy = into / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    return len(files)
