"""`python -m truenorth`: the command line."""

from truenorth.cli import main

main()
