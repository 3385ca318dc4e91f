"""Unwrap a mesh: seams along its edges, and a map that is one to one."""
