"""A case: files in an empty folder and a command; made from a kind, a seed and a number alone."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

KINDS = ("scene", "file", "study", "override", "sweep", "reader")


@dataclass
class Case:
    """What is run.

    Parameters
    ----------
    name : str
        Kind, seed and number; enough to make it again.
    files : dict
        Contents by name. A name that starts with ``@`` is a symbolic link, one with ``|`` a pipe.
    argv : list of str
        The command's arguments. ``simulate`` stands for a run without a folder and figures.
    """

    name: str
    files: dict[str, bytes] = field(default_factory=dict)
    argv: list[str] = field(default_factory=list)

    def put(self, folder: Path) -> None:
        """Write the files into an empty folder."""
        import os

        for name, content in self.files.items():
            path = folder / name.lstrip("@|")
            path.parent.mkdir(parents=True, exist_ok=True)
            if name.startswith("@"):
                path.symlink_to(content.decode())
            elif name.startswith("|"):
                os.mkfifo(path)
            else:
                path.write_bytes(content)


def make_case(kind: str, seed: int, number: int) -> Case:
    """Return one case; the same arguments always give the same one."""
    from fuzz_files import file_case
    from fuzz_overrides import override_case
    from fuzz_readers import reader_case
    from fuzz_scenes import scene_case
    from fuzz_studies import study_case
    from fuzz_sweep import sweep_case

    makers: dict[str, Callable[[random.Random, Case], Case]] = {
        "scene": scene_case,
        "file": file_case,
        "study": study_case,
        "override": override_case,
        "reader": reader_case,
    }
    name = f"{kind}-{seed}-{number}"
    if kind == "sweep":
        return sweep_case(number, Case(name))
    return makers[kind](random.Random(name), Case(name))
