"""Which version of dsa_des runs, and has written what a folder holds."""

__version__ = "0.2.0"
