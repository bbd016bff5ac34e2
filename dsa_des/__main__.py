"""The program ``dsa-des``, also ``python -m dsa_des``: ctrl-C ends it plainly from the start.

Next to nothing is imported before that is so.
"""

import gc
import os
import signal

from dsa_des.terminal.interruption import exit_plainly_on_signal

_NEW_OBJECTS_PER_COLLECTION = 300_000


def start() -> None:
    """Run the command line and end the program."""
    # Modules and models are made by the thousand and stay: looking for garbage among them was a
    # tenth of the time to start. A short run ends with some 140,000 objects: it never looks.
    gc.set_threshold(_NEW_OBJECTS_PER_COLLECTION, 20, 50)
    try:
        with exit_plainly_on_signal():
            from dsa_des.cli import main

            main()
    finally:
        # The interpreter's last look for garbage goes through every module: a tenth of a short run,
        # and the system takes the memory back anyway.
        gc.freeze()
        # All that is left is Python's own end, which would show ctrl-C as a traceback.
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, lambda number, frame: os._exit(128 + number))


if __name__ == "__main__":
    start()
