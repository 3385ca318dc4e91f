"""The computed map: from a bare cloud to a flat map of it, without training."""
