"""Association: which detection belongs to which track, by distance alone."""
