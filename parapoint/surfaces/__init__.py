"""Surfaces and their maps: meshes and clouds, how they are cut, sampled and prepared."""
