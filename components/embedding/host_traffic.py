"""The traffic source of a scene that a host program drives (``traffic.host``)."""

from fractions import Fraction
from typing import Any, Self

from pydantic import Field, model_validator

from components.aircraft.aircraft import Aircraft, Roster
from components.messages.reach import combined_farthest_look
from components.messages.targets import TrafficStates
from dsa_des.block.component import Component, Output, Parameters
from dsa_des.errors import Disagreements

# A host says itself when it ends; effects that ask for the length of the run are told a year.
_NO_END_S = Fraction(365 * 86400)


class Plane(Aircraft):
    """An aircraft that the host moves."""

    name: str = Field(min_length=1, description="Name; keys its random draws.")

    @model_validator(mode="after")
    def _refuse_cooperative_keys(self) -> Self:
        Disagreements.raise_if_any(
            [
                f"{key} is given: cooperative sensors need to know where aircraft are between the "
                "host's calls, so none can run in such a scene; leave it out"
                for key in ("mode_s", "mode_c", "ads_b", "icao_address")
                if getattr(self, key)
            ]
        )
        return self


class HostTrafficParameters(Parameters):
    """Parameters of traffic whose positions a host program gives."""

    planes: list[Plane] = Field(default=[], description="Aircraft that are known from the start.")


class HostTraffic(Component):
    """Traffic whose positions a host program passes in; such a scene only runs inside a host.

    See `dsa_des.embed.Simulator`.
    """

    outputs = {"states": Output(TrafficStates, "Positions and attitudes of all aircraft.")}
    Parameters = HostTrafficParameters
    windowed = True
    clocked = "demand"
    needs_host = (
        "positions come from a host program: drive this scene with dsa_des.embed.Simulator, or "
        "swap its traffic for one that flies by itself"
    )

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.roster = Roster.from_pairs([(plane.name, plane) for plane in parameters.planes])

    def offer(self, port: str) -> Roster:
        """Return the roster, which lists the targets and their properties, for consumers."""
        return self.roster

    def natural_duration_s(self) -> Fraction:
        """Return the duration, s, of scenes that give none: practically endless."""
        return _NO_END_S

    def setup(self) -> None:
        """Refuse sensors that need positions at instants that a host does not give."""
        if (
            combined_farthest_look(consumer.request for consumer in self.context.consumers).lasts_s
            > 0.0
        ):
            raise ValueError(
                "a sensor needs to know where aircraft are at instants between the host's calls, "
                "as beam_sweep, measures_range_rate and moving_target_filter do: a host program "
                "says where they are at its calls only"
            )

    @property
    def width(self) -> int:
        """Number of targets, which is the number of planes."""
        return len(self.roster)
