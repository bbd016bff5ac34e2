"""What the ownship believes of its own position and attitude."""
