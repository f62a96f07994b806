"""`python -m services.cli` is `marey`."""

from services.cli.main import run

if __name__ == "__main__":
    run()
