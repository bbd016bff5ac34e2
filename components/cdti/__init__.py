"""The display of the operator: a scene in real time, in a browser, with a person who decides."""
