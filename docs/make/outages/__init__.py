"""Tables of the shipped studies of a radar that fails, for docs/scenes.md."""
