"""Maps of planar domains: one to one, their energy brought down, their seams led on."""
