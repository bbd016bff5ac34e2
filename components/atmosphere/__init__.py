"""What the air does to radio waves and light on their way to the sensor."""
