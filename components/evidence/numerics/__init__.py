"""Hard cases of the numerics: the naive way, ours and a reference."""
