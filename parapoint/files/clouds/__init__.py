"""Formats of clouds alone: bytes in, `Content` out."""
