"""The pictures and figures of a report."""
