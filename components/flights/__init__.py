"""Flights as pure functions of time: scripted, sampled and steered, of one aircraft and of many."""
