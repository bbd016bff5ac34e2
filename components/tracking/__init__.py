"""What is remembered of a target between detections."""
