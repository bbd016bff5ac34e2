"""The page on accuracy and cost, and the maps of errors on it."""
