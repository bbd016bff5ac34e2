"""Where aircraft fly: scripted, random and recorded flights."""
