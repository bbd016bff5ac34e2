"""Results of studies, from their folders to tables and figures: no scene and no block is read."""
