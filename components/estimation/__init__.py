"""Estimation: motion, measurements and Kalman filters, over many tracks at once."""
