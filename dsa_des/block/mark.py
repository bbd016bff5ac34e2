"""How a block is marked in every figure: told by its class, so that figures need not know it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

#: Okabe and Ito's colours, told apart with any kind of colour vision.
BLUE, RED, GREEN, ORANGE, PINK, SKY, BLACK = PALETTE = (
    "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#000000",
)  # fmt: skip


@dataclass(frozen=True)
class Mark:
    """A colour and a marker.

    Parameters
    ----------
    colour : str
        ``#RRGGBB``.
    marker : str
        As Matplotlib names it.
    size_pt : float
    """

    colour: str
    marker: str
    size_pt: float = 5.0


#: Of blocks whose class says nothing: the colours of Okabe and Ito, and of Tol, that no class of
#: ours has; told apart with any kind of colour vision.
NEUTRAL = (
    Mark(SKY, "P"),
    Mark("#777777", "X"),
    Mark("#882255", "v"),
    Mark("#999933", "p"),
    Mark("#332288", "h"),
)
#: Markers of the second, third, ... block of a kind; the colour stays.
_FURTHER = ("d", "<", ">", "8", "*")


def plot_mark_by_name(classes: Mapping[str, type | None]) -> dict[str, Mark]:
    """Return name → plot mark (colour and marker): that of the block's class, or neutral."""
    own = {name: getattr(cls, "mark", None) for name, cls in classes.items()}
    return distinguish_marks(
        {n: mark if isinstance(mark, Mark) else None for n, mark in own.items()}
    )


def distinguish_marks(kinds: Mapping[str, Mark | None]) -> dict[str, Mark]:
    """Return name → plot mark: equal marks keep colour but differ in marker; None gets neutral."""
    found: dict[str, Mark] = {}
    before: dict[Mark, int] = {}
    unknown = 0
    for name in sorted(kinds):
        own = kinds[name]
        if own is None:
            found[name] = NEUTRAL[unknown % len(NEUTRAL)]
            unknown += 1
            continue
        again = before.get(own, 0)
        before[own] = again + 1
        found[name] = replace(own, marker=_FURTHER[(again - 1) % len(_FURTHER)]) if again else own
    return found
