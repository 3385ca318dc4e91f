"""Pictures of surfaces and of maps on them, for `score --heatmap` and for reports."""
