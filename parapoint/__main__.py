"""`python -m parapoint`: the command `parapoint`."""

from parapoint.cli import main

main()
