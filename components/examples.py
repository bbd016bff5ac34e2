"""The folder of the shipped scenes and studies."""

from pathlib import Path


def folder() -> Path:
    """Return the folder of the shipped scenes and studies: in the package, or in its source."""
    here = Path(__file__).parent
    packaged = here / "configs"
    return packaged if packaged.is_dir() else here.parent / "configs"
