"""The effect of the air on radio waves and light on their way to the sensor."""
