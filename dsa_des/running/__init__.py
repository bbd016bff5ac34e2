"""One run of a scene: blocks as processes, wires as channels, time in windows."""
