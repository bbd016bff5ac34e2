"""Traffic: scripted, random and recorded flights."""
