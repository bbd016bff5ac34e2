"""The folder of the shipped scenes and studies."""

from pathlib import Path


def configs_folder() -> Path:
    """Return the folder of shipped scenes and studies: in the installed package or source tree."""
    here = Path(__file__).parent
    packaged = here / "configs"
    return packaged if packaged.is_dir() else here.parent / "configs"
