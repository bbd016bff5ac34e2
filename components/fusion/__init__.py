"""Which detections of several sensors belong together, and what they say."""
