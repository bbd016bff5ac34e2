"""The thesis's results, figure by figure: what it prints, what we get, and why they differ.

`table` lists the items, each with what makes it, by subject; `reproduce` makes them.
"""
