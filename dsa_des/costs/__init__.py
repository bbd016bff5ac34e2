"""What accuracy costs: a scene run with each model of a block in turn, all else fixed."""
