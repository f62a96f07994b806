"""Files of the product that are computed from prepared data, by `python -m` of the module that knows how."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from marey.data.prepared import PreparedData
from marey.motion.files import write_atomically


def write_measured(
    arguments: Sequence[str] | None, description: str, file: Path, document: Callable[[PreparedData], str]
) -> None:
    """Read the command line of such a module, write the document of a prepared folder, and print it.

    Args:
        arguments: of the command line; None = those of the process.
        description: for `--help`.
        file: what is written without `--output`.
        document: its text.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("prepared", type=Path, help="Folder of `marey data prepare`.")
    parser.add_argument("-o", "--output", type=Path, default=file)
    chosen = parser.parse_args(arguments)
    text = document(PreparedData.open(chosen.prepared))
    write_atomically(chosen.output, text.encode())
    sys.stdout.write(text)
