"""The page of the camera that sees pictures, docs/pictures.md."""
