"""How a map is judged."""
