"""``python -m docs.make.reference``: docs/reference.md, from the code."""
