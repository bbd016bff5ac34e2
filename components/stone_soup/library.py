"""Whether Stone Soup is there; it is imported only where it is used."""

from importlib.util import find_spec


def needs_stone_soup(what: str) -> None:
    """Say how to install the extra if it is missing.

    Parameters
    ----------
    what : str
        What needs it, for the message.

    Raises
    ------
    ImportError
        Stone Soup is not installed.
    """
    if find_spec("stonesoup") is None:
        raise ImportError(f"{what} needs Stone Soup: pip install 'dsa-des[stonesoup]'")
