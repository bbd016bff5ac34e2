"""What makes the pages of the docs; it may import everything, nothing imports it."""
