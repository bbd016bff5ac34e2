"""A console of Rich on which text is text: no markup, no control characters, no emoji codes."""

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

from dsa_des.text.safe_text import escape_unprintable


class SafeConsole(Console):
    """A Rich console that prints every ``str`` literally, with control characters escaped.

    Text of several lines is given as `rich.text.Text`, whose line feeds stay; all else that is
    not printable is escaped in it as well. Parameters are those of `rich.console.Console`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, markup=False, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a ``str`` as rich Text without markup, with control characters escaped."""
        options |= {"markup": False, "emoji": False}
        return super().render_str(escape_unprintable(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render as Rich does, escaping what is not printable or the stream cannot encode."""
        encoding = self.encoding or "utf-8"
        for segment in super().render(renderable, options):
            text = segment.text
            if segment.control or (text.isascii() and text.isprintable()):
                yield segment
                continue
            # A stream may know fewer letters than Unicode has.
            known = escape_unprintable(text, lines=True).encode(encoding, "backslashreplace")
            yield Segment(known.decode(encoding), segment.style)
