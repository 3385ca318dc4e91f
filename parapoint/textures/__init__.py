"""Textures: what is painted on a surface through its map."""
