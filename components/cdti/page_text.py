"""The page of the display: one HTML file with style and program inside, and what it may do."""

from functools import cache

from components.view.page import page_filled, page_part, page_program

_PACKAGE = "components.cdti"
#: The program's parts, in the order in which they need each other.
SCRIPTS = ("link.js", "symbols.js", "scope.js", "camera.js", "sound.js", "panel.js", "app.js")


@cache
def page() -> tuple[str, str]:
    """Return the page, which holds nothing of the run, and its program's digest.

    All that is said of a run comes over the socket, and is put on screen as text.
    """
    script, digest = page_program(_PACKAGE, SCRIPTS)
    contents = {"style": page_part(_PACKAGE, "style.css"), "script": script}
    return page_filled(_PACKAGE, "cdti.html", contents), digest


def headers(socket_address: str) -> dict[str, str]:
    """Return the headers with which the page is sent.

    The browser may run the one program inside, talk to this server's socket, and nothing else.
    """
    _, digest = page()
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
