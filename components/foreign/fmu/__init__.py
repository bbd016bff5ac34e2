"""FMUs in a scene, and a scene as an FMU."""
