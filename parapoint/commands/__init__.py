"""What the command `parapoint` offers, one file a command."""
