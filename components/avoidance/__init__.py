"""What the ownship does about what it sees."""
