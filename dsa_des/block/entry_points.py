"""Entry points of this and other packages, by group and name."""

from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points

#: The group of block types.
COMPONENTS = "dsa_des.components"


@lru_cache(maxsize=16)
def entry_points_of(group: str = COMPONENTS) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name, sorted."""
    found = {point.name: point for point in entry_points(group=group)}
    return dict(sorted(found.items()))
