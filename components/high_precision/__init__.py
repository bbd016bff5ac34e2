"""The quantities that blocks compute, computed again at 40 digits."""
