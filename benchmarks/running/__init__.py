"""How cells are run: one process each, within limits, here or on a cluster."""
