"""Hard cases: what a naive formula gives, what ours gives, and what is true."""
