"""`python -m marey.cli` is `marey`."""

from marey.cli.start import run

if __name__ == "__main__":
    run()
