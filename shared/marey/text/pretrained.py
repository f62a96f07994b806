"""Loading `transformers` models from a folder: offline, safetensors only, with errors that name the remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from marey.core.documents import read_json
from marey.core.errors import InvalidFile, NotFound


def read_config(folder: Path) -> dict[str, Any]:
    """The folder's `config.json`. Raises InvalidFile."""
    file = folder / "config.json"
    try:
        config = read_json(file, hint="Fetch the encoder again.")
    except NotFound as error:
        raise InvalidFile("is missing", where=str(file), hint="Fetch the encoder again.") from error
    if not isinstance(config, dict):
        raise InvalidFile("is not a model configuration", where=str(file), hint="Fetch the encoder again.")
    return cast("dict[str, Any]", config)


def load_pretrained(kind: Any, folder: Path, *, weights: bool = False) -> Any:
    """`kind.from_pretrained(folder)`, in evaluation mode where it is a model.

    Raises:
        InvalidFile: the folder cannot be loaded, or a weight of the model is missing.
    """
    try:
        if not weights:
            return kind.from_pretrained(folder, local_files_only=True)
        model, report = kind.from_pretrained(
            folder, local_files_only=True, use_safetensors=True, output_loading_info=True
        )
    except Exception as error:  # the libraries raise everything from OSError to bare Exception
        raise InvalidFile(
            f"cannot be loaded as {kind.__name__}: {error}", where=str(folder), hint="Fetch the encoder again."
        ) from error
    if report["missing_keys"] or report["mismatched_keys"]:
        missing = ", ".join(sorted(map(str, [*report["missing_keys"], *report["mismatched_keys"]]))[:3])
        raise InvalidFile(f"lacks weights of {kind.__name__}: {missing}", where=str(folder), hint="Fetch it again.")
    return model.eval()
