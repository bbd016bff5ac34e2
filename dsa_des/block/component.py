"""What a block is: the class that it derives from, and what it is told of its run."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from dsa_des.arrays.types import IntArray
from dsa_des.block.effect import Built, Effect, Hook
from dsa_des.block.ladder import Ladder, Verified
from dsa_des.block.mark import Mark
from dsa_des.block.message import Message
from dsa_des.block.parameters import ClockedParameters as ClockedParameters
from dsa_des.block.parameters import NonNegativeRational as NonNegativeRational
from dsa_des.block.parameters import Parameters as Parameters
from dsa_des.block.parameters import PositiveRational as PositiveRational
from dsa_des.block.parameters import Rational as Rational
from dsa_des.block.parameters import ScenePath as ScenePath
from dsa_des.block.parameters import SourcedText as SourcedText
from dsa_des.block.parameters import to_scene_number as to_scene_number
from dsa_des.block.ports import Consumer as Consumer
from dsa_des.block.ports import Input as Input
from dsa_des.block.ports import Output as Output
from dsa_des.block.ports import Producer as Producer
from dsa_des.errors import did_you_mean
from dsa_des.time.clock import ClockSpec
from dsa_des.time.randomness import Stream, Streams

if TYPE_CHECKING:
    from dsa_des.block.wake import Wake


@dataclass
class Context:
    """What the engine tells a block about the run it is part of.

    Parameters
    ----------
    streams : Streams
        The run's keyed random numbers.
    ticks_per_s : int
    duration_s : Fraction
        Length of the run; infinite sources may cut their work at it.
    consumers : list of Consumer
        Blocks that our outputs feed, sorted by name; known when `Component.setup` is called.
    producers : list of Producer
        Blocks that feed our inputs, sorted by name; known when effects are planned.
    sections : mapping
        The scene's tables that belong to no block, by name (`dsa_des.sections`).
    effects : dict
        What was built of this block's effects, by name, in the order of their declaration; known
        when `Component.setup` is called.
    simulate_everything : bool
        Whether a block must not leave out work that cannot change a result.
    recorded_runs : int
        How many runs of the scene are recorded together.
    recorded_tables : collection of str, optional
        The tables that somebody reads of what is recorded; None for all that there are.
    tolerance : mapping
        What of ``[accuracy]`` the effects left out of this block have not used up, by quantity.
    rewinds : bool
        Whether the engine may take blocks of this run back to an instant before.
    platform : str
        What carries the block, of what another one names as `Component.platforms`: its key
        ``platform``, or else what carries the blocks that feed it.
    """

    streams: Streams
    ticks_per_s: int = 10**9
    duration_s: Fraction = Fraction(0)
    consumers: list[Consumer] = field(default_factory=list)
    producers: list[Producer] = field(default_factory=list)
    sections: Mapping[str, Any] = field(default_factory=dict)
    effects: dict[str, Any] = field(default_factory=dict)
    simulate_everything: bool = False
    recorded_runs: int = 1
    recorded_tables: Collection[str] | None = None
    tolerance: Mapping[str, float] = field(default_factory=dict)
    rewinds: bool = False
    platform: str = ""


class Component:
    """A block. Subclass it, declare ports and parameters, and write `run`.

    Invariants kept by the engine: at one instant a block runs at most once, after every block
    upstream over undelayed wires; `run` sees each message once; instants never go backwards.
    """

    #: Inputs and outputs by name.
    inputs: ClassVar[Mapping[str, Input]] = {}
    outputs: ClassVar[Mapping[str, Output]] = {}
    #: Model of the block's parameters.
    Parameters: ClassVar[Any] = Parameters
    #: Whether `run` accepts many rows at once. Say False when a row depends on feedback.
    windowed: ClassVar[bool] = False
    #: Whether the engine may take the block back to an earlier state. Its attributes, and those of
    #: its effects, must then hold all of that state; arrays, lists, dicts and sets among them may
    #: be changed in place, anything within them must be replaced instead.
    rewindable: ClassVar[bool] = False
    #: Whether one instance may serve many runs in lock step: its `run` treats every row by itself,
    #: draws by `Stream.of_runs`, and remembers each run (`Wake.run`) apart from the others: the
    #: next wake comes back to each but those before its `Wake.first_run`. A class says so of its
    #: own code and of the effects that it lists, and of the classes of its package that derive
    #: from it: one of another package that does not say it again gets an instance for each run.
    lockstep: ClassVar[bool] = False
    #: Attributes that hold what it remembers from one wake to the next; () for none. Where its
    #: parameters, or what its neighbours say, change while a run lasts, another instance goes on
    #: with these. None where the block does not say: it goes on as it is.
    remembers: ClassVar[tuple[str, ...] | None] = None
    #: Whether one instance goes through all changes of its parameters, and heeds them.
    heeds_changes: ClassVar[bool] = False
    #: How many targets a row counts as at least, where windows of a single run are sized: what the
    #: block makes of each row is there until its window ends.
    least_width: ClassVar[int] = 4
    #: "own": runs on the clock of its parameters (or only when triggered);
    #: "demand": runs at the scan instants of the clocked blocks downstream.
    clocked: ClassVar[Literal["own", "demand"]] = "own"
    #: Quantities that effects may act on, each with its contract. Those of base classes count too.
    #: The block asks for what was built by `built`.
    hooks: ClassVar[tuple[Hook[Any], ...]] = ()
    #: Physics that is built only when the scene calls for it (`dsa_des.block.effect`). Each acts on
    #: one of the `hooks`.
    effects: ClassVar[tuple[Effect, ...]] = ()
    #: Models that can fill this block, from crude to exact (`dsa_des.block.ladder`).
    ladders: ClassVar[tuple[Ladder, ...]] = ()
    #: What the model was held against; that of base classes counts too.
    verified: ClassVar[tuple[Verified, ...]] = ()
    #: Message types that `records` may name beside those of the outputs.
    also_records: ClassVar[tuple[type[Message], ...]] = ()
    #: Why a scene with this block cannot be run as a whole, and what to do; empty where it can.
    needs_host: ClassVar[str] = ""
    #: Whether what it records is reason enough for it, wired to somebody or not.
    stands_alone: ClassVar[bool] = False
    #: How figures mark it; a neutral one by default.
    mark: ClassVar[Mark | None] = None

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for said, unsaid in (("lockstep", False), ("remembers", None)):
            if said not in vars(cls) and not _is_defined_in_own_package(cls, said):
                setattr(cls, said, unsaid)

    def __init__(self, name: str, parameters: Any, context: Context) -> None:
        self.name = name
        self.p = parameters
        self.context = context

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return the clock that parameters describe, or None: on demand, or when triggered."""
        if isinstance(parameters, ClockedParameters):
            return parameters.clock_spec()
        return None

    @classmethod
    def class_for(cls, parameters: Any) -> "type[Component]":
        """Return the class to build for a block with these parameters; by default this one.

        A subclass with the same parameters and ports, where these decide what it can do.
        """
        return cls

    @classmethod
    @lru_cache(maxsize=512)
    def all_hooks(cls) -> tuple[Hook[Any], ...]:
        """Return the hooks of this class and its bases."""
        found = [hook for base in reversed(cls.__mro__) for hook in vars(base).get("hooks", ())]
        return tuple(dict.fromkeys(found))

    @classmethod
    def ladders_for(cls, parameters: Any) -> tuple[Ladder, ...]:
        """Return the ladders of models, crude to exact, that such a block is part of."""
        return cls.ladders

    def request(self, port: str) -> Any:
        """Return what the block feeding input `port` gets as `Consumer.request`; None for none."""
        return None

    def offer(self, port: str) -> Any:
        """Return what receivers of output `port` get as `Producer.offer`; None for nothing."""
        return None

    def platforms(self) -> Sequence[str]:
        """Return the platforms this block moves, by name; the first is the default carrier.

        Its offers and messages are then seen from what carries the receiver
        (`Message.seen_from`; an offer has a method of that name). Asked before offers.
        """
        return ()

    def records(self) -> Sequence[type[Message]]:
        """Return the message types that this block records; called once its effects are known.

        By default those of its outputs. A block that sends a subclass, or has a table that a scene
        may ask for, says so here.
        """
        return [output.message for output in self.outputs.values()]

    def setup(self) -> None:
        """Prepare for the run; called once, after every block downstream was set up."""

    def natural_duration_s(self) -> Fraction | None:
        """Return the data's length, s, for scenes without ``duration_s``; None sets none."""
        return None

    def acts_every_s(self) -> Fraction | None:
        """Return the period, s, of running even without messages; None: only on messages.

        For a block that is triggered and must act in time all the same: `Wake.idle` says at which
        rows nothing came. Asked once, after `setup`; the same of all runs in lock step.
        """
        return None

    @property
    def width(self) -> int:
        """Number of targets in each row sent; decides how many rows are computed at once."""
        return 1

    def run(self, wake: "Wake") -> Message | Mapping[str, Message] | None:
        """Handle the instants of `wake` and return the messages to send.

        Parameters
        ----------
        wake : Wake
            The instants (one, or a window of many) and the messages that have arrived.

        Returns
        -------
        Message, mapping from output name to Message, or None
            A lone message goes to the only output.
        """
        raise TypeError(f"{type(self).__name__} declares neither run nor process")

    #: A block that wants its own SimPy generator overrides this with a method ``(self, env)``.
    process: Any = None

    def report(self) -> dict[str, Any]:
        """Return sections of the run's summary that only this block knows."""
        return {}

    def close(self) -> None:
        """Release what runs outside the simulation; called if a block failed and the run ends."""

    def warnings(self) -> list[str]:
        """Return warnings about parameters of this block that decide results without being noticed
        or that can hardly be meant; called after `setup`.

        One sentence each, which names the parameter; the engine adds the block's name.
        """
        return []

    def failure_counts(self) -> Mapping[str, tuple[int, int] | IntArray]:
        """Return what work lacked → (failures, cases), or an array (2, runs) of both by run.

        Asked after it has run; counts are over every row that it has seen. A block that serves all
        runs gives both of each run, (2, runs)
        (`dsa_des.record.failure_counts.counts_with_cases_added`).
        """
        return {}

    def skipped_work_notes(self) -> list[str]:
        """Return sentences on work skipped without changing results; called after `setup`."""
        return []

    def built(self, acts_on: Hook[Built]) -> list[Built]:
        """Return what active effects have built for the quantity `acts_on`, in declared order.

        Raises
        ------
        ValueError
            If the quantity is none of the block's `hooks`.
        """
        known = self.all_hooks()
        if acts_on not in known:
            raise ValueError(
                f"{self.import_path()} asks for effects that act on {acts_on!r}, which is not "
                f"among its "
                f"hooks{did_you_mean(acts_on, known)}"
            )
        return [
            self.context.effects[effect.name]
            for effect in type(self).effects
            if effect.acts_on == acts_on and effect.name in self.context.effects
        ]

    def built_one(self, acts_on: Hook[Built]) -> Built | None:
        """Return what the only active effect on `acts_on` has built, or None without one."""
        if not (built := self.built(acts_on)):
            return None
        (one,) = built
        return one

    def apply_change(self, from_s: Fraction, other: Any) -> None:
        """Switch to the parameters of this block's instance `other` from time `from_s` on.

        Of a block that `heeds_changes`; called before anything is offered.
        """
        raise TypeError(f"{self.import_path()} heeds no change")

    def adopt_state(self, before: "Component") -> None:
        """Copy the state of this block's instance `before`, with its effects', to go on from it.

        What it makes at its first wake is not there where it changes before that.
        """
        pairs: list[tuple[Any, Any]] = [(self, before)]
        of_before = before.context.effects
        pairs += [(new, of_before.get(name)) for name, new in self.context.effects.items()]
        for new, old in pairs:
            for name in getattr(new, "remembers", None) or ():
                if hasattr(old, name):
                    setattr(new, name, getattr(old, name))

    def serves_replicas(self) -> bool:
        """Return whether one instance can serve all replicas of a lock-step simulation."""
        return type(self).lockstep

    def make_for_all_runs(
        self, parameters: Sequence[Any], make: Callable[[int], "Component"]
    ) -> "Component | None":
        """Return one component for all lock-step runs, or None if each needs its own ``make(run)``.

        Asked of a block that cannot be shared as it is, once it is set up. What it returns gets the
        rows of all runs, which may go side by side, and gives what each instance would. It must
        be sure that each of them would ask and offer its neighbours the same as this one does.
        `parameters` are the block's in each run; `make` gives the block as the run of a number has
        it, not set up.
        """
        return None

    def stream(self, purpose: str) -> Stream:
        """Return this block's stream of keyed random numbers for one purpose."""
        return self.context.streams.stream(self.name, purpose)

    @classmethod
    def import_path(cls) -> str:
        """Return the class as text ``module:Class``."""
        return f"{cls.__module__}:{cls.__qualname__}"


def _is_defined_in_own_package(cls: type[Component], said: str) -> bool:
    """Return whether `cls` gets attribute `said` from a class of its own top-level package."""
    base = next(base for base in cls.__mro__ if said in vars(base))
    return base.__module__.partition(".")[0] == cls.__module__.partition(".")[0]


@dataclass(eq=False)
class RunEnd(Message):
    """A run is over: the instant of a row is the first that is no longer part of it.

    Whoever sends one need not be wired to anybody. Nothing of this instant or a later one is
    recorded, and no block runs then; of replicas that run together the others go on. The first row
    counts. As every row it is of an instant at which the block ran, so that the end of a run
    follows from what came before it.
    """


def may_end_its_run(block: type[Component]) -> bool:
    """Return whether blocks of a class can end their run: one of its outputs sends `RunEnd`."""
    return any(issubclass(output.message, RunEnd) for output in block.outputs.values())


__all__ = [
    "ClockedParameters",
    "Component",
    "Consumer",
    "Context",
    "Input",
    "NonNegativeRational",
    "Output",
    "Parameters",
    "PositiveRational",
    "Producer",
    "Rational",
    "ScenePath",
    "SourcedText",
]
