"""What a page may say, and how it is checked before anything is done with it."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

#: A message is a line of text; this is some ten times the longest that a page sends, bytes.
LARGEST_BYTES = 2048
_MOST_DEG, _MOST_M = 180.0, 3000.0


class _Said(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Ready(_Said):
    """The operator is there: the run may begin."""

    type: Literal["ready"]


class Drawn(_Said):
    """A frame is on screen: another one may be sent."""

    type: Literal["drawn"]
    frame: int = Field(ge=0, le=2**53)


class Chosen(_Said):
    """A contact was chosen, whose camera picture is wanted."""

    type: Literal["chosen"]
    target: int = Field(ge=-1, le=10**7)


class Judged(_Said):
    """An alert is on screen, was looked at, or was judged."""

    type: Literal["decide"]
    id: str = Field(pattern=r"^[0-9a-f]{8,40}$")
    decision: Literal["shown", "looked", "verified", "rejected"]
    target: int = Field(ge=0, le=10**7)


class Turned(_Said):
    """The ownship is told to turn, deg to the right."""

    type: Literal["decide"]
    id: str = Field(pattern=r"^[0-9a-f]{8,40}$")
    decision: Literal["turn"]
    target: int = Field(ge=-1, le=10**7)
    value: float = Field(ge=-_MOST_DEG, le=_MOST_DEG, allow_inf_nan=False)


class Climbed(_Said):
    """The ownship is told to climb, m upward."""

    type: Literal["decide"]
    id: str = Field(pattern=r"^[0-9a-f]{8,40}$")
    decision: Literal["climb"]
    target: int = Field(ge=-1, le=10**7)
    value: float = Field(ge=-_MOST_M, le=_MOST_M, allow_inf_nan=False)


Decided = Annotated[Judged | Turned | Climbed, Field(discriminator="decision")]
PageMessage = Ready | Drawn | Chosen | Judged | Turned | Climbed
_READER: TypeAdapter[PageMessage] = TypeAdapter(
    Annotated[Ready | Drawn | Chosen | Decided, Field()]
)


def read_message(text: str | bytes) -> PageMessage:
    """Return what a page said.

    Raises
    ------
    ValueError
        It is no such message; the reason holds nothing of it.
    """
    if isinstance(text, bytes):
        raise ValueError("is not text")
    if len(text) > LARGEST_BYTES:
        raise ValueError("is too long")
    try:
        return _READER.validate_json(text)
    except ValidationError as error:
        kinds = sorted({problem["type"] for problem in error.errors(include_input=False)})
        raise ValueError(f"is no message of this page ({', '.join(kinds[:3])})") from None
