"""Studies: many runs of one scene over axes and random draws, their metrics and statistics."""
