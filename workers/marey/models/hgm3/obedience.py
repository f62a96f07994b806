"""Does a bundle of HGM³ do what the prompts say? See `marey.training.adherence`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from marey.core.errors import MareyError
from marey.models.hgm3.generate import Generator
from marey.training.adherence import parser_of, publish, report_of


def main(arguments: Sequence[str] | None = None) -> None:
    """Judge one bundle."""
    chosen = parser_of("marey.models.hgm3.obedience").parse_args(arguments)
    report = report_of(Generator.load(chosen.bundle, threads=chosen.threads), chosen)
    publish(report.to_json(), report.markdown(), chosen.output)


if __name__ == "__main__":
    try:
        main()
    except MareyError as error:
        sys.exit(f"{error}")
