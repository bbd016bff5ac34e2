"""The geometry blocks: from where aircraft are to where they are seen."""
