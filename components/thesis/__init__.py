"""The thesis's results, figure by figure: what it prints, what we get, and why they differ.

One file per family of figures; `registry` lists the items, `reproduce` makes them.
"""
