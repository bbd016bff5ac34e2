"""The program ``dsa-des``, also ``python -m dsa_des``: ctrl-C ends it plainly from the start.

Next to nothing is imported before that is so.
"""

import os
import signal

from dsa_des.interruption import plain_ending


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


if __name__ == "__main__":
    start()
