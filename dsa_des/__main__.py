"""The program ``dsa-des``, also ``python -m dsa_des``: ctrl-C ends it plainly from the start.

Next to nothing is imported before that is so.
"""

import signal

from dsa_des.interruption import plain_ending


def start() -> None:
    """Run the command line and end the program."""
    try:
        with plain_ending():
            from dsa_des.cli import main

            main()
    finally:
        # All that is left is Python's own end, which has no patience with ctrl-C.
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, signal.SIG_DFL)


if __name__ == "__main__":
    start()
