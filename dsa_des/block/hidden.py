"""Another package of the name of one of ours, found before it on the module path."""

import importlib.util
import sys
from pathlib import Path

from dsa_des.errors import UsageError

#: Where our packages lie side by side.
_HOME = Path(__file__).parents[2]


def refuse_hidden(module_name: str) -> None:
    """Make sure that a module of ours is imported from our package.

    Parameters
    ----------
    module_name : str
        Such as ``components.gate``.

    Raises
    ------
    UsageError
        If another package of the name comes first, with its file.
    """
    top = module_name.partition(".")[0]
    ours = _HOME / top
    found = _place_of(top)
    if found is None or not (ours / "__init__.py").is_file():
        return
    folder = found.parent if found.name == "__init__.py" else found
    if folder == ours or folder.resolve() == ours.resolve():
        return
    raise UsageError(
        f"the module {top!r} is {found}, which hides the package {ours} that dsa-des needs: "
        "give it another name, or take it off the Python path"
    )


def _place_of(top: str) -> Path | None:
    """Return the file of a module, imported or not; the folder of one without ``__init__.py``."""
    try:
        loaded = sys.modules.get(top)
        spec = importlib.util.find_spec(top) if loaded is None else None
    except (ImportError, ValueError, OSError):
        return None
    file = getattr(loaded, "__file__", None) or (spec and spec.has_location and spec.origin)
    if file:
        return Path(file)
    places = getattr(loaded, "__path__", None) or (spec and spec.submodule_search_locations)
    return next(map(Path, places or ()), None)
