"""From a TOML file to a checked scene: reading, overriding, wiring, checking."""
