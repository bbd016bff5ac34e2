"""The effect of the air on radio waves and light on their way to the sensor.

Functions take numbers or arrays that broadcast together, and return an array of the broadcast shape
in the unit of their name or first sentence; ValueError names an argument that is not finite, out of
the range that is given for it, or an unknown name.
"""
