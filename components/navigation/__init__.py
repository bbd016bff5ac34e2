"""The ownship's belief of its own position and attitude."""
