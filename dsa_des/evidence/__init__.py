"""A case of evidence: requirements, the studies that answer them, and the folder that shows it."""
