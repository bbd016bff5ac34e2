"""A run to be watched: one page that opens from disk, in any browser, without a network."""
