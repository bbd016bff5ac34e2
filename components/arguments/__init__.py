"""Which arguments physics functions accept, and how they become arrays."""
