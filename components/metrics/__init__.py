"""What a study measures of an encounter: detection, declaration, fusion, tracks."""
