"""Classical methods that flatten a disk, each one equation and one file."""
