"""Files written: anew, or again with new UVs."""
