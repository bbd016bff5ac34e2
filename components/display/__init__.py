"""A detect-and-sense run summed up, as tables and as figures."""
