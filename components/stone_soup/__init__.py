"""Stone Soup's objects out of ours, and its trackers as blocks; needs the extra ``stonesoup``."""
