"""One import: what the user asks for, checked before a file of the download is read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from marey.bundles import Bundle
from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.registry import ImportKind, import_kinds, resolve

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
"""Names of bundles."""
LICENCE = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+-]{0,99}")
"""SPDX identifiers, and `LicenseRef-…` for what has none."""


@dataclass(frozen=True)
class ImportRequest:
    """The argument of an import kind's `run`.

    Attributes:
        kind: of the weights.
        folder: of the published files.
        output: the bundle's folder, whose name is the bundle's; nothing is there, unless `overwrite`.
        licence: terms of the weights, as given or as the kind knows them.
        text_encoder: folder of the text encoder that the weights were trained with; None = the installed one.
        overwrite: replace an existing bundle.
    """

    kind: str
    folder: Path
    output: Path
    licence: str
    text_encoder: Path | None = None
    overwrite: bool = False


def run_import(
    kind: str,
    folder: Path,
    output: Path,
    *,
    text_encoder: Path | None = None,
    licence: str | None = None,
    overwrite: bool = False,
) -> Bundle:
    """Import published weights, and return the bundle; a failure leaves nothing behind.

    Args:
        kind: a registered kind.
        folder: of the published files, as downloaded.
        output: the bundle's folder.
        text_encoder: folder of the text encoder, as the models' hub has it.
        licence: terms of the weights (SPDX); None = those that the kind knows.
        overwrite: replace an existing bundle.

    Raises:
        NotFound: unknown kind, or a part is missing.
        Conflict: the bundle already exists.
        InvalidInput: no licence is known or its identifier is invalid, the kind reads no text encoder, or the name
            cannot be a bundle's.
        InvalidFile: a part is damaged, foreign, or of another configuration.
        PluginError: a plug-in cannot be loaded.
    """
    chosen = find_kind(kind)
    output = output.absolute()
    if not NAME.fullmatch(output.name):
        raise InvalidInput(f"{output.name!r} cannot be the name of a bundle", where=str(output))
    if output.exists() and not overwrite:
        raise Conflict(
            "already exists",
            where=str(output),
            hint="To import again and replace it, pass overwrite=True; else choose another name.",
            argument="overwrite",
        )
    if text_encoder is not None and not chosen.text_encoder:
        raise InvalidInput(f"the kind {kind!r} reads no text encoder", where="text_encoder", argument="text_encoder")
    request = ImportRequest(kind, folder, output, _licence(chosen, licence), text_encoder, overwrite)
    return resolve(chosen.run)(request)


def find_kind(name: str) -> ImportKind:
    """Return a registered kind of import.

    Raises:
        NotFound: there is none of this name; the hint lists the known ones.
        PluginError: a plug-in cannot be loaded.
    """
    known = import_kinds()
    if name not in known:
        lines = "\n".join(f"  {each.name:<22} {each.help}" for each in known.values())
        raise NotFound(f"unknown kind {name!r} of weights", hint=f"Known here:\n{lines}")
    return known[name]


def _licence(kind: ImportKind, given: str | None) -> str:
    licence = given or kind.licence
    if licence is None:
        raise InvalidInput(
            f"the source of {kind.name} states no licence of its weights",
            where="licence",
            hint="Read its terms, and name them by an SPDX identifier, or LicenseRef-NAME where there is none; a name "
            "with -NC forbids commercial use.",
            argument="licence",
        )
    if not LICENCE.fullmatch(licence):
        raise InvalidInput(
            f"invalid licence {licence!r}", where="licence", hint="Name it by its SPDX identifier.", argument="licence"
        )
    return licence
