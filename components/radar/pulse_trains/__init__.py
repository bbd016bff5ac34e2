"""What follows from a radar's pulses: eclipsing, folded ranges, and several PRFs."""
