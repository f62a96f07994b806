"""Command line of modules that compute files of the product from prepared data (`python -m`)."""

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
    """Parse the command line of such a module, write the document of a prepared folder, and print it.

    Args:
        arguments: command line; None = that of the process.
        description: description for `--help`.
        file: output file without `--output`.
        document: returns the text of the file.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("prepared", type=Path, help="Folder of `marey data prepare`.")
    parser.add_argument("-o", "--output", type=Path, default=file)
    chosen = parser.parse_args(arguments)
    text = document(PreparedData.open(chosen.prepared))
    write_atomically(chosen.output, text.encode())
    sys.stdout.write(text)
