"""The cost of accuracy: a scene run with each model of a block in turn, all else fixed."""
