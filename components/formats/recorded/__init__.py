"""Files that people have of flights, whatever their kind."""
