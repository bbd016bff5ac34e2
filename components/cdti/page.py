"""The page of the display: what it holds and may do, which page may decide, and what it may say."""

import secrets
from functools import cache
from hmac import compare_digest
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from components.view.page import fill_page_template, page_script_and_digest, read_page_file

_PACKAGE = "components.cdti"
#: The program's parts, in the order in which they need each other.
SCRIPTS = (
    "link.js", "units.js", "symbols.js", "rose.js", "scope.js", "tapes.js", "legend.js",
    "camera.js", "sound.js", "panel.js", "app.js",
)  # fmt: skip
OPERATOR, WATCHER = "operator", "watcher"
#: A message is a line of text; this is some ten times the longest that a page sends, bytes.
LARGEST_BYTES = 2048
_MOST_DEG, _MOST_M = 180.0, 3000.0


@cache
def page_html_and_script_digest() -> tuple[str, str]:
    """Return the HTML of the display page and the SHA-256 digest of its script.

    All that is said of a run comes over the socket, and is put on screen as text.
    """
    script, digest = page_script_and_digest(_PACKAGE, SCRIPTS)
    contents = {"style": read_page_file(_PACKAGE, "style.css"), "script": script}
    return fill_page_template(_PACKAGE, "cdti.html", contents), digest


def page_headers(socket_address: str) -> dict[str, str]:
    """Return the page's HTTP headers, which allow only its own script and this socket.

    The browser may run the one program inside, talk to this server's socket, and nothing else.
    """
    _, digest = page_html_and_script_digest()
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        f"connect-src {socket_address}; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )
    return {
        "Content-Type": "text/html; charset=utf-8",
        "Content-Security-Policy": policy,
        "Cache-Control": "no-store",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
    }


class Admission:
    """Hands out the right to decide, to one page at a time.

    The address holds a token. The first page that comes with it may decide, and gets a key by which
    it is known when it comes back; the token then is used up, and only lets watch. When the page of
    the operator is gone for good, `unused_operator_token` gives a new one.
    """

    def __init__(self) -> None:
        self.token = _new_token()
        self._fresh = True
        self._watching = [self.token]
        self._key = ""

    def is_issued_token(self, token: str) -> bool:
        """Return whether a token was issued in this run, even if it only lets watch by now."""
        return any(_is_equal_in_constant_time(token, known) for known in self._watching)

    def role_and_key(self, token: str, key: str) -> tuple[str, str]:
        """Return the role and the operator's key (empty for a watcher) that token and key give."""
        if self._key and _is_equal_in_constant_time(key, self._key):
            return OPERATOR, self._key
        if self._fresh and _is_equal_in_constant_time(token, self.token):
            self._fresh = False
            self._key = _new_token()
            return OPERATOR, self._key
        return WATCHER, ""

    def unused_operator_token(self) -> str:
        """Return a token to become operator, new if the last was used; earlier keys stay valid."""
        if not self._fresh:
            self.token, self._fresh = _new_token(), True
            self._watching.append(self.token)
        return self.token


def _new_token() -> str:
    return secrets.token_urlsafe(24)


def _is_equal_in_constant_time(one: str, other: str) -> bool:
    return compare_digest(one.encode("utf-8", "replace"), other.encode())


class _FromPage(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Ready(_FromPage):
    """The operator reports to be ready, so that the run may begin."""

    type: Literal["ready"]


class Drawn(_FromPage):
    """A page reports that it has drawn a frame, so that another one may be sent."""

    type: Literal["drawn"]
    frame: int = Field(ge=0, le=2**53)


class Chosen(_FromPage):
    """A page asks for the camera's picture of this contact."""

    type: Literal["chosen"]
    target: int = Field(ge=-1, le=10**7)


class _Decided(_FromPage):
    type: Literal["decide"]
    id: str = Field(pattern=r"^[0-9a-f]{8,40}$")


class Judged(_Decided):
    """An alert is on screen, was looked at, or was judged."""

    decision: Literal["shown", "looked", "verified", "rejected"]
    target: int = Field(ge=0, le=10**7)


class Turned(_Decided):
    """A command to the ownship to turn, deg to the right."""

    decision: Literal["turn"]
    target: int = Field(ge=-1, le=10**7)
    value: float = Field(ge=-_MOST_DEG, le=_MOST_DEG, allow_inf_nan=False)


class Climbed(_Decided):
    """A command to the ownship to climb, m upward."""

    decision: Literal["climb"]
    target: int = Field(ge=-1, le=10**7)
    value: float = Field(ge=-_MOST_M, le=_MOST_M, allow_inf_nan=False)


Decided = Annotated[Judged | Turned | Climbed, Field(discriminator="decision")]
PageMessage = Ready | Drawn | Chosen | Judged | Turned | Climbed
_READER: TypeAdapter[PageMessage] = TypeAdapter(
    Annotated[Ready | Drawn | Chosen | Decided, Field()]
)


def read_message(text: str | bytes) -> PageMessage:
    """Return the message of a page; ValueError with a reason that holds nothing of it."""
    if isinstance(text, bytes):
        raise ValueError("is not text")
    if len(text) > LARGEST_BYTES:
        raise ValueError("is too long")
    try:
        return _READER.validate_json(text)
    except ValidationError as error:
        kinds = sorted({problem["type"] for problem in error.errors(include_input=False)})
        raise ValueError(f"is no message of this page ({', '.join(kinds[:3])})") from None
