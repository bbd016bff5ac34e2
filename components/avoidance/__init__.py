"""The ownship's reaction to what it sees."""
