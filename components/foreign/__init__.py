"""Other people's parts as blocks of a scene."""
