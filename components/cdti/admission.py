"""Who may decide, who may watch, and who is not let in."""

import secrets
from hmac import compare_digest

OPERATOR, WATCHER = "operator", "watcher"


class Admission:
    """Hands out the right to decide, to one page at a time.

    The address holds a token. The first page that comes with it may decide, and gets a key by which
    it is known when it comes back; the token then is used up, and only lets watch. When the page of
    the operator is gone for good, `renew` gives a new token.
    """

    def __init__(self) -> None:
        self.token = _secret()
        self._fresh = True
        self._watching = [self.token]
        self._key = ""

    def knows(self, token: str) -> bool:
        """Return whether a token is one of this run, used up or not."""
        return any(_same(token, known) for known in self._watching)

    def role(self, token: str, key: str) -> tuple[str, str]:
        """Return what a page may do, and the key of the one that decides.

        Parameters
        ----------
        token, key : str
            From its address, and what it was given before; the token is one of this run.
        """
        if self._key and _same(key, self._key):
            return OPERATOR, self._key
        if self._fresh and _same(token, self.token):
            self._fresh = False
            self._key = _secret()
            return OPERATOR, self._key
        return WATCHER, ""

    def renew(self) -> str:
        """Return a token with which a page may decide again; the last one's key stays valid."""
        if not self._fresh:
            self.token, self._fresh = _secret(), True
            self._watching.append(self.token)
        return self.token


def _secret() -> str:
    return secrets.token_urlsafe(24)


def _same(one: str, other: str) -> bool:
    return compare_digest(one.encode("utf-8", "replace"), other.encode())
