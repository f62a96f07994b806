"""Text encoder `distilbert-base-uncased`: DistilBERT, 768-d (Sanh et al. 2019, arXiv 1910.01108), which TMR reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from marey.core.documents import read_json
from marey.core.errors import InvalidFile
from marey.text.encoders import HUB, WIDTHS
from marey.text.pretrained import read_config
from marey.text.states_encoder import StatesEncoder

ARCHITECTURE = "DistilBertForMaskedLM"
"""Of the published weights; others of this shape were trained further for some task."""
TOKENIZER = "tokenizer.json"


class DistilBertEncoder(StatesEncoder):
    """Token states of DistilBERT, [CLS] and [SEP] included."""

    def __init__(self, name: str, folder: Path) -> None:
        from transformers import DistilBertModel

        check_distilbert(name, folder)
        super().__init__(name, folder, DistilBertModel)


def check_distilbert(name: str, folder: Path) -> None:
    """Check that configuration and tokenizer in a folder are those of DistilBERT without case.

    Raises:
        InvalidFile: they are missing, of another model, of one that was trained further, or of one that tells upper
            case from lower case.
    """
    config, hint = read_config(folder), f"It needs {HUB[name]}."
    if config.get("model_type") != "distilbert" or config.get("dim") != WIDTHS[name]:
        raise InvalidFile(f"is not DistilBERT of width {WIDTHS[name]}", where=str(folder), hint=hint)
    if config.get("architectures") != [ARCHITECTURE]:
        raise InvalidFile(
            f"is not {name}: its weights are those of {config.get('architectures')}", where=str(folder), hint=hint
        )
    tokenizer = folder / TOKENIZER
    if tokenizer.is_file():
        content: Any = read_json(tokenizer, hint=hint)
        normalizer: Any = cast("dict[str, Any]", content).get("normalizer") if isinstance(content, dict) else None
        if not isinstance(normalizer, dict) or cast("dict[str, Any]", normalizer).get("lowercase") is not True:
            raise InvalidFile(f"is not {name}: its tokenizer keeps upper case", where=str(tokenizer), hint=hint)
