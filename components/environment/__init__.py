"""The tables of a scene that every block can read: weather, terrain, accuracy."""

from components.environment.tables import Accuracy, Navigation, Terrain, Weather

__all__ = ["Accuracy", "Navigation", "Terrain", "Weather"]
