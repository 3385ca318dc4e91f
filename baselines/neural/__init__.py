"""Neural maps by other authors, trained for one shape at a time."""
