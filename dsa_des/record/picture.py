"""A figure as a value: its PNG bytes, shown inline in notebooks."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from dsa_des.files.output_file import write_file


@dataclass(frozen=True)
class PictureFile:
    """A drawn figure.

    Parameters
    ----------
    name : str
        For example ``plan``.
    png : bytes
    """

    name: str
    png: bytes = field(repr=False)

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the figure as a PNG file.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        write_file(Path(path), self.png)


def pictures_in(folder: Path) -> dict[str, bytes]:
    """Return the figures of a folder as name → PNG bytes, in order of their names."""
    return {file.stem: file.read_bytes() for file in sorted(folder.glob("*.png"))}
