"""Files that hold surfaces: how they are read and written."""
