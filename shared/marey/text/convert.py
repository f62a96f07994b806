"""Write the bundle of MiniLM from its published weights, once, offline.

    python -m marey.text.convert minilm FOLDER -o models/minilm-l6

Weights of other text encoders and labellers are imported by `marey models import`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from marey.core.characters import escape
from marey.core.errors import MareyError
from marey.text.minilm_bundle import import_minilm


def main(arguments: list[str] | None = None) -> int:
    """The command line of this module; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m marey.text.convert", description="See the module.")
    commands = parser.add_subparsers(dest="command", required=True)
    minilm = commands.add_parser("minilm", help="all-MiniLM-L6-v2 to a bundle in 8 bits")
    minilm.add_argument("folder", type=Path, help="folder with its model.safetensors and tokenizer.json")
    minilm.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args(arguments)
    try:
        made = import_minilm(options.folder, options.output).path
    except MareyError as error:
        sys.stderr.write(f"{escape(str(error))}\n")
        return error.exit_code
    sys.stdout.write(f"{made}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
