"""Tables of a scene that belong to no single block, such as ``[weather]``.

Their models are found by the entry-point group ``dsa_des.sections``: the name of the table, and a
`dsa_des.component.Parameters` class that has a default for every key. Every block can read them
in `Context.sections`.
"""

from functools import lru_cache

from dsa_des.component import Parameters
from dsa_des.entry_points import registered
from dsa_des.foreign import installed

SECTIONS = "dsa_des.sections"


@lru_cache(maxsize=1)
def section_models() -> dict[str, type[Parameters]]:
    """Return the registered section models by table name, sorted."""
    return {name: installed(point) for name, point in registered(SECTIONS).items()}
