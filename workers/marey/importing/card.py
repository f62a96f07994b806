"""The card of an imported bundle, and the fields of its manifest that say where the weights come from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from marey.bundles import TextSpec
from marey.importing.checkpoint import Account
from marey.importing.request import ImportRequest

CARD = """# {name}, imported

{about}

Written by `marey models import {kind}` from the files below. Terms of the weights: {licence}.

## Files

| file | bytes | sha256 | tensors used |
|---|---|---|---|
{files}

## Left out

{ignored}

## Normalisation

{normalisation}

## Text encoder

{text}
"""


def make_card(
    request: ImportRequest,
    accounts: Sequence[Account],
    *,
    about: str,
    normalisation: str = "The weights read no motion features.",
    text: TextSpec | None = None,
) -> str:
    """Return the model card of an imported bundle.

    Args:
        request: the import.
        accounts: of all files that were read.
        about: paragraphs: paper, training data, limits, and figures to compare with.
        normalisation: which mean and deviation the bundle holds, and from which file.
        text: the text encoder; None = it reads no text.
    """
    files = "\n".join(f"| `{each.file}` | {each.bytes:,} | `{each.sha256}` | {len(each.used)} |" for each in accounts)
    return CARD.format(
        name=request.output.name,
        about=about.strip(),
        kind=request.kind,
        licence=request.licence,
        files=files,
        ignored=_ignored(accounts),
        normalisation=normalisation.strip(),
        text="None." if text is None else f"`{text.encoder}`, weights `{text.encoder_sha256}`, width {text.width}.",
    )


def provenance(request: ImportRequest, accounts: Sequence[Account]) -> dict[str, Any]:
    """Return the manifest's field `training`: the command, and every file with its hash and tensors."""
    return {
        "command": f"marey models import {request.kind} FOLDER -o {request.output.name}",
        "files": [
            {"file": each.file, "bytes": each.bytes, "sha256": each.sha256, "tensors": len(each.used)}
            for each in accounts
        ],
    }


def _ignored(accounts: Sequence[Account]) -> str:
    lines = [line for each in accounts for line in _lines(each.file, each.ignored or {})]
    return "\n".join(lines) or "No tensors."


def _lines(file: str, ignored: Mapping[str, str]) -> list[str]:
    """One line a reason: `file`: n tensors (the first one, …): reason."""
    counts = Counter(ignored.values())
    first = {reason: name for name, reason in reversed(list(ignored.items()))}
    return [
        f"- `{file}`: `{first[reason]}`" + (f" and {count - 1} more" if count > 1 else "") + f": {reason}."
        for reason, count in counts.items()
    ]
