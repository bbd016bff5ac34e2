"""What studies measure of a detect-and-sense run: detection, declaration, fusion, encounters."""
