"""The program ``dsa-des``, also ``python -m dsa_des``: ctrl-C ends it plainly from the start.

Next to nothing is imported before that is so.
"""

import os
import signal
import sys

from dsa_des.terminal.interruption import plain_ending


def start() -> None:
    """Run the command line and end the program."""
    try:
        with plain_ending():
            from dsa_des.cli import main

            main()
    finally:
        # All that is left is Python's own end, which would show ctrl-C as a traceback.
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, lambda number, frame: os._exit(128 + number))


def _without_working_directory() -> None:
    """Take the working directory off the module path, where ``python -m`` puts it first.

    A folder ``components`` there is not ours. The folder that we were imported from stays.
    """
    home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if not sys.flags.safe_path and sys.path[:1] == [os.getcwd()] != [home]:
        del sys.path[0]


if __name__ == "__main__":
    _without_working_directory()
    start()
