"""Effects: named pieces of physics that are built only when a scene calls for them.

A block declares its effects. Each looks at the block's parameters and the scene's sections and
says whether it can change any result, *and because of what*. Only those that can are built; what
is not built does not exist in the run, so it costs nothing. With ``simulate_everything`` every
effect that can be parametrised neutrally is built all the same, and the recordings must not
change by a bit.
"""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

#: What effects build for a hook.
Built = TypeVar("Built")


class Hook(str, Generic[Built]):
    """A quantity that effects may act on: its name, with the contract of what they build for it.

    Parameters
    ----------
    name : str
        For people, "SNR"; an effect may name it so.
    contract : type
        A protocol of what the block calls, or the type of a value.
    meaning : str
        What is returned, or what the value is.
    """

    contract: type[Built]
    meaning: str

    def __new__(cls, name: str, contract: type[Built], meaning: str) -> "Hook[Built]":
        hook = super().__new__(cls, name)
        hook.contract, hook.meaning = contract, meaning
        return hook

    @property
    def builds_callable(self) -> bool:
        """Whether effects on this quantity build something to call rather than a value."""
        return any("__call__" in vars(base) for base in self.contract.__mro__)

    def signature_text(self) -> str:
        """Return how the effect is called and what that returns, such as ``(cells) -> factor of
        each cell's SNR``; for a value only its meaning.
        """
        if not self.builds_callable:
            return self.meaning
        _, *names = inspect.signature(self.contract.__call__).parameters
        return f"({', '.join(names)}) -> {self.meaning}"


@dataclass(frozen=True)
class Verdict:
    """Whether an effect matters, and why.

    Parameters
    ----------
    simulated : bool
    because : str
        What in the scene decides, for example ``[weather] rain_rate_mm_h is 0``.
    bound : mapping
        Largest possible influence by quantity (``detection_probability``, ``range_m``, ...),
        where it is proven; the keys are those of ``[accuracy]``.
    """

    simulated: bool
    because: str
    bound: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of_flag(cls, parameters: Any, name: str) -> "Verdict":
        """Return a verdict: wanted if the parameter `name` is true; its value is the reason."""
        asked = bool(getattr(parameters, name))
        return cls(asked, f"{name} is {str(asked).lower()}")


class Effect(Generic[Built]):
    """One effect of a block type; stateless, shared by all blocks of that type.

    Whether what it builds may get rows of several runs in one call is said by the block that lists
    it (`Component.lockstep`).
    """

    #: What it is called.
    name: ClassVar[str]
    #: The quantity it acts on, one of the hooks of its block, whose contract `build` keeps.
    acts_on: Hook[Built]
    #: Whether it can be built when the scene does not call for it, without changing a bit: not
    #: where the next one says something.
    neutral: ClassVar[bool] = True
    #: Why nothing can be built that changes no bit.
    outside_the_proof: ClassVar[str] = ""

    #: Parameter of the block that is true where the effect is asked for, if that is all.
    flag: ClassVar[str] = ""
    #: What makes, from the block, what the block calls at run time, if that is all.
    builds: ClassVar[Any] = None

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if cls.outside_the_proof:
            cls.neutral = False

    def verdict(self, block: Any) -> Verdict:
        """Return whether this effect matters in the block (a `Component`) of the scene, and why."""
        if self.flag:
            return Verdict.of_flag(block.p, self.flag)
        raise TypeError(f"{type(self).__name__} gives no verdict")

    def build(self, block: Any) -> Built:
        """Return the function or value that this effect gives the `Component` at run time."""
        if self.builds is None:
            raise TypeError(f"{type(self).__name__} builds nothing")
        built: Built = type(self).builds(block)
        return built
