"""Aircraft as sensors see them, and the aircraft of a run."""

from components.aircraft.aircraft import Aircraft, Roster

__all__ = ["Aircraft", "Roster"]
