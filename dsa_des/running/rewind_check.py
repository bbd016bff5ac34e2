"""A check that blocks can be rewound: each window runs twice and must be the same.

`Component.rewindable` is a promise about all of a block's state. A generator of random numbers, a
list within a list or a variable of its module that breaks it would show in nothing but results
that depend on the length of windows.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dsa_des.block.component import Component
from dsa_des.block.message import by_output
from dsa_des.block.wake import Wake
from dsa_des.errors import BlockFailure
from dsa_des.running.fingerprint import message_fingerprints, state_fingerprints
from dsa_des.running.rewind import Rewinder
from dsa_des.running.run_state import RunningBlock
from dsa_des.running.windows import Failure, Window, Windows

#: What a block sent in one call: fingerprints by output and field.
Sent = dict[str, bytes]

_RULE = (
    "its attributes and those of its effects must hold all of its state; what lies within a list, "
    "dict or array among them must be replaced, not changed in place; otherwise it must not "
    "declare rewindable = True"
)


@dataclass
class Seen:
    """What was seen of one run of a window.

    Parameters
    ----------
    calls : list of (block, its component, what it sent)
        In the order of execution.
    states : dict
        Block → attribute → fingerprint, after the window.
    """

    calls: list[tuple[str, Component, Sent]]
    states: dict[str, dict[str, bytes]]


class Witness:
    """Notes what blocks send in a window, and what they remember after it."""

    def __init__(self, components: Iterable[Component]) -> None:
        self._components = {component.name: component for component in components}
        self._calls: list[tuple[str, Component, Sent]] = []
        #: How many windows were compared.
        self.windows = 0

    def begin(self) -> None:
        """Forget what was sent: a window begins."""
        self._calls = []

    def runner(self, component: Component) -> "Watched":
        """Return what runs a block, and notes what it sends."""
        return Watched(component, self)

    def note(self, component: Component, sent: Sent) -> None:
        """Note what a block sent."""
        self._calls.append((component.name, component, sent))

    def seen(self) -> Seen:
        """Return what was seen since `begin`."""
        states = {name: state_fingerprints(block) for name, block in self._components.items()}
        return Seen(self._calls, states)

    def compare(
        self,
        first: Seen,
        failure: Failure | None,
        times_s: tuple[float, float],
    ) -> None:
        """Compare what was seen since `begin` with the first run of the same window.

        Parameters
        ----------
        first : Seen
        failure : Failure, optional
            What a block raised the second time.
        times_s : (start, end)
            Of the window, s.

        Raises
        ------
        BlockFailure
            Names the first block, in order of execution, that did something else.
        """
        self.windows += 1
        again = self.seen()
        for (name, component, one), (_, _, other) in zip(first.calls, again.calls, strict=False):
            if one != other:
                what = _first_difference(one, other)
                raise _not_the_same(name, component, times_s, f"sends something else ({what})")
        if failure is not None:
            block = failure.said.block
            said = f"fails the second time ({failure.said.reason})"
            raise _not_the_same(block, self._components[block], times_s, said) from failure.cause
        ran = list(dict.fromkeys(name for name, _, _ in first.calls))
        for name in [*ran, *sorted(set(self._components) - set(ran))]:
            if first.states[name] != again.states[name]:
                what = _first_difference(first.states[name], again.states[name])
                said = f"remembers something else ({what})"
                raise _not_the_same(name, self._components[name], times_s, said)


class Watched:
    """Runs a block and tells a `Witness` what it sends."""

    def __init__(self, component: Component, witness: Witness) -> None:
        self._component, self._witness = component, witness

    def run(self, wake: Wake) -> Any:
        """Run the block."""
        result = self._component.run(wake)
        sent: Sent = {}
        for port, message in by_output(result, tuple(self._component.outputs)).items():
            for name, value in message_fingerprints(message).items():
                sent[f"output {port}, field {name}"] = value
        self._witness.note(self._component, sent)
        return result


class WindowsRunTwice:
    """Windows of a run that is rewound, each of which runs a second time and must give the same.

    Parameters
    ----------
    windows : Windows
        Those that may be undone.
    rewinder : Rewinder
        Theirs.
    nodes : mapping
        The running blocks, which are watched from now on.
    ticks_per_s : int
    """

    def __init__(
        self,
        windows: Windows,
        rewinder: Rewinder,
        nodes: Mapping[str, RunningBlock],
        ticks_per_s: int,
    ) -> None:
        self._windows, self._rewinder, self._ticks_per_s = windows, rewinder, ticks_per_s
        self.witness = Witness(node.component for node in nodes.values())
        for node in nodes.values():
            node.runner = self.witness.runner(node.component)
        #: A window that stands, up to where all is final then, and what was seen of it.
        self._again: tuple[Window, int, Seen] | None = None

    def limit(self, longest_ticks: int) -> None:
        """Let no window be longer than this."""
        self._windows.limit(longest_ticks)

    def next(self) -> Window | None:
        """Return the same window again, or the next."""
        self.witness.begin()
        return self._windows.next() if self._again is None else self._again[0]

    def heard(self, window: Window, failure: Failure | None) -> int | None:
        """Have a window that stands run again, and compare."""
        if self._again is None:
            final = self._windows.heard(window, failure)
            if final is None or failure is not None:
                return final
            self._again = window, final, self.witness.seen()
            self._rewinder.restore()
            return None
        (_, final, first), self._again = self._again, None
        times_s = window.start / self._ticks_per_s, window.end / self._ticks_per_s
        self.witness.compare(first, failure, times_s)
        return final


def _first_difference(one: Mapping[str, bytes], other: Mapping[str, bytes]) -> str:
    names: Sequence[str] = [*one, *(name for name in other if name not in one)]
    return next(name for name in names if one.get(name) != other.get(name))


def _not_the_same(
    name: str, component: Component, times_s: tuple[float, float], what: str
) -> BlockFailure:
    start_s, end_s = times_s
    reason = (
        f"it does not come back when it is rewound: run again from its saved state to "
        f"t = {end_s:.3f} s, it {what}; {_RULE}"
    )
    return BlockFailure(name, component.path(), start_s, None, reason)
