"""What a run costs, measured against a plain loop over the same physics."""
