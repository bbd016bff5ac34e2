"""The version of dsa_des that runs, and that has written what a folder holds."""

__version__ = "0.3.0"
