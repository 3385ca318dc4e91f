"""Methods that other programs and libraries provide."""
