"""One-to-one maps of planar domains: their start, their descent, and the growth of their seams."""
