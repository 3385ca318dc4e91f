"""Formats of meshes, and of clouds in the same files: bytes in, `Content` out."""
