"""Text that every reader takes: made printable, and JSON without ``NaN``."""
