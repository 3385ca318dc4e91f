"""Where results are kept: rows, maps and metrics on disk."""
