"""Encounters of an airspace: models that make them, sets that hold them, and what is at stake.

Units here are those of the published encounter models where a name says so (feet, knots, degrees
per second), since their files and formulas are written in them; blocks and tables outside are SI.
"""
