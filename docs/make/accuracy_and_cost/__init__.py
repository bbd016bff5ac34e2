"""``python -m docs.make.accuracy_and_cost``: docs/accuracy-and-cost.md and its figures."""
