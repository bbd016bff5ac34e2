"""Files of flights and of encounters, read strictly: all that is wrong is said at once."""
