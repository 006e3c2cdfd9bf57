"""`python -m pointmass.cli` is `pointmass`."""

from pointmass.cli.main import main

main()
