"""`python -m services.cli` is `marey`."""

from services.cli.main import run

run()
