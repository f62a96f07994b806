"""Imports as the registry knows them: kinds of published weights that become bundles by `marey models import`.

Kinds of a model's weights are a part of its spec. A kind of anything else, such as an evaluator or a text encoder, is
registered by one line of its own; entry point and kind have the same name:

    [project.entry-points."marey.imports"]
    t2m-evaluator = "marey.evaluator.spec:T2M_IMPORT"
"""

from __future__ import annotations

from dataclasses import dataclass

from marey.registry.plugins import PlugIns


@dataclass(frozen=True)
class ImportKind:
    """A kind of published weights: `marey models import NAME FOLDER -o BUNDLE`.

    Attributes:
        name: as on the command line.
        help: one line: which weights, and which folder.
        run: reference `module:function` to `(marey.importing.ImportRequest) -> Bundle`.
        licence: terms of the public weights (SPDX, or a LicenseRef); None = their source states none, so that
            `--licence` is required.
        text_encoder: True if it reads `--text-encoder`.
    """

    name: str
    help: str
    run: str
    licence: str | None = None
    text_encoder: bool = False


IMPORTS = PlugIns("marey.imports", ImportKind, lambda kind: kind.name)
