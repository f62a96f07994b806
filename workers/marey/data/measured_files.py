"""Modules that compute files of the product from prepared data (`python -m`): their command line and header."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from marey.data.prepared import PreparedData
from marey.motion.files import write_atomically


def provenance(module: str, data: PreparedData) -> list[str]:
    """Return the first lines of a TOML document: the module that writes it, and the data it is computed from."""
    return [
        f"# Written by `python -m {module}`; docs/reference/quality.md explains it.",
        "",
        "[provenance]",
        f'prepared_sha256 = "{data.sha256}"',
        f"sources = {json.dumps([source.name for source in data.manifest.sources])}",
        f'tier = "{data.manifest.tier}"',
    ]


def write_measured(description: str, file: Path, document: Callable[[PreparedData], str]) -> None:
    """Parse the command line of such a module, write the document of a prepared folder, and print it.

    Args:
        description: description for `--help`.
        file: output file without `--output`.
        document: returns the text of the file.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("prepared", type=Path, help="Folder of `marey data prepare`.")
    parser.add_argument("-o", "--output", type=Path, default=file)
    chosen = parser.parse_args()
    text = document(PreparedData.open(chosen.prepared))
    write_atomically(chosen.output, text.encode())
    sys.stdout.write(text)
