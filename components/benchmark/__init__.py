"""The cost of a run, measured against a plain loop over the same physics."""
