"""Files of a text encoder in the layout of the models' hub: checked, and written as a bundle of the same layout."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.core.documents import read_json
from marey.core.errors import InvalidFile, NotFound
from marey.core.hashing import sha256_of
from marey.importing.checkpoint import Account, Checkpoint
from marey.text.clip_encoder import check_clip
from marey.text.distilbert_encoder import check_distilbert
from marey.text.encoders import HUB, WIDTHS
from marey.text.loading import load_encoder
from marey.text.pretrained import read_config
from marey.text.t5_encoder import check_t5

WEIGHTS, PICKLED = "model.safetensors", "pytorch_model.bin"
TOKENIZER = "tokenizer.json"
TOKENIZER_FILES = (TOKENIZER, "tokenizer_config.json", "special_tokens_map.json")
SENTENCEPIECE, PAIRS = "spiece.model", ("vocab.json", "merges.txt")
"""Vocabularies of T5 and CLIP in their first formats."""
EXTRA_IDS = 100
"""Marks of T5's training that stand behind its vocabulary."""
SENTENCES = ("a person walks forward", "a person sits quietly")
"""Encoded once to check that weights and tokenizer work together."""


@dataclass(frozen=True)
class Published:
    """Facts of a published text encoder, by which its files are checked.

    Attributes:
        licence, credit: of the weights.
        keep: regular expression of the tensors of the text tower; the rest is not needed.
        left: reason why the rest is left out where weights are converted.
        markers: tensors that only this version has, each with the length of its last axis.
        blocks: regular expression of the number of a layer in a tensor's name.
        layers: fields of the configuration that hold the number of layers, one within the other.
    """

    licence: str
    credit: str
    keep: str
    left: str
    markers: Mapping[str, int]
    blocks: str
    layers: tuple[str, ...]


_CLIP = "Radford et al. 2021, Learning Transferable Visual Models From Natural Language Supervision"
_CLIP_KEEP = r"text_model\.(?!embeddings\.position_ids).*|text_projection\.weight"
_CLIP_LEFT = "the image tower, or computed anew"
_CLIP_BLOCKS = r"text_model\.encoder\.layers\.(\d+)\."
_T5 = "Raffel et al. 2020, Exploring the Limits of Transfer Learning"
_T5_KEEP = r"shared\.weight|encoder\.(block|final_layer_norm)\..*"
_T5_LEFT = "the decoder, or a copy of the embedding"
_T5_BLOCKS = r"encoder\.block\.(\d+)\."
_T5_FEED_FORWARD = "encoder.block.0.layer.1.DenseReluDense."


def _clip(width: int) -> Published:
    """CLIP's text tower with states of a width."""
    return Published(
        licence="MIT",
        credit=_CLIP,
        keep=_CLIP_KEEP,
        left=_CLIP_LEFT,
        markers={"text_model.embeddings.token_embedding.weight": width, "text_projection.weight": width},
        blocks=_CLIP_BLOCKS,
        layers=("text_config", "num_hidden_layers"),
    )


PUBLISHED = {
    "clip-vit-b32": _clip(512),
    "clip-vit-l14": _clip(768),
    "t5-base": Published(
        "Apache-2.0", _T5, _T5_KEEP, _T5_LEFT,
        {"shared.weight": 768, f"{_T5_FEED_FORWARD}wi.weight": 768}, _T5_BLOCKS, ("num_layers",),
    ),
    "t5-v1_1-base": Published(
        "Apache-2.0", _T5, _T5_KEEP, _T5_LEFT,
        {"shared.weight": 768, f"{_T5_FEED_FORWARD}wi_0.weight": 768, f"{_T5_FEED_FORWARD}wi_1.weight": 768},
        _T5_BLOCKS, ("num_layers",),
    ),
    "distilbert-base-uncased": Published(
        "Apache-2.0",
        "Sanh et al. 2019, DistilBERT, a distilled version of BERT",
        r"distilbert\.(embeddings|transformer)\..*",
        "the head that predicts masked words",
        {"distilbert.embeddings.word_embeddings.weight": 768},
        r"distilbert\.transformer\.layer\.(\d+)\.",
        ("n_layers",),
    ),
}  # fmt: skip


def write_encoder(
    name: str, source: Path, output: Path, *, licence: str | None = None, overwrite: bool = False
) -> Bundle:
    """Write the bundle of a text encoder: its files in the hub's layout, with a manifest and a card.

    Weights in safetensors are copied as they are, so that the encoder has the same identity as the hub's files; of
    `pytorch_model.bin` the tensors of the text tower are kept.

    Args:
        name: of the encoder, as in `TextSpec`.
        source: folder with `config.json`, weights and tokenizer.
        output: the bundle's folder.
        licence: of the weights; None = as published.
        overwrite: replace an existing bundle.

    Raises:
        NotFound: the folder or a file is missing.
        InvalidFile: another encoder, another version or width of it, or damaged files.
        Conflict: the bundle already exists.
    """
    known = PUBLISHED[name]
    if not source.is_dir():
        raise NotFound("there is no such folder", where=str(source), hint=f"It should hold the files of {HUB[name]}.")
    _check_files(name, source)
    with (
        BundleWriter(output, overwrite=overwrite) as writer,
        TemporaryDirectory(prefix=".", dir=output.parent) as temporary,  # /tmp may not have room for a gigabyte
    ):
        weights, account = _weights(name, source, Path(temporary))
        writer.add_json("config.json", read_config(source))
        for file, content in _tokenizer(name, source, Path(temporary)).items():
            writer.add_json(file, content)
        writer.copy_part("encoder", {WEIGHTS: weights})
        _try(name, writer.folder, source)
        writer.add_card(CARD.format(name=name, hub=HUB[name], credit=known.credit, account=account))
        return writer.finish(
            name=output.name,
            version="1",
            kind="encoder",
            model=name,
            config=name,
            parameters={"width": WIDTHS[name]},
            data=(DataSource(name=HUB[name], licence=licence or known.licence, credit=known.credit),),
            licence=licence or known.licence,
            training={"command": f"marey models import {name} FOLDER -o {output.name}", "sha256": account.sha256},
        )


def _check_files(name: str, source: Path) -> None:
    if name.startswith("t5"):
        check_t5(name, source)
    elif name.startswith("distilbert"):
        check_distilbert(name, source)
    else:
        check_clip(name, source)


def _weights(name: str, source: Path, temporary: Path) -> tuple[Path, Account]:
    """Return the safetensors file to copy, checked, and the account of the file it comes from."""
    file = source / WEIGHTS
    if file.is_file():
        with _opened(file) as tensors:
            shapes = {key: tuple(tensors.get_slice(key).get_shape()) for key in tensors.keys()}  # noqa: SIM118
            _check_version(name, shapes, file, source)
            kept = [key for key in shapes if re.fullmatch(PUBLISHED[name].keep, key)]
            for key in kept:
                _check_finite(key, tensors.get_tensor(key), file)
        return file, Account(WEIGHTS, file.stat().st_size, sha256_of(file), tuple(kept))
    pickled = source / PICKLED
    if not pickled.is_file():
        raise NotFound(
            f"the weights are missing: there is no {WEIGHTS} or {PICKLED}",
            where=str(source),
            hint=f"The folder needs the files of {HUB[name]}.",
        )
    return _convert(name, pickled, temporary / WEIGHTS)


def _convert(name: str, pickled: Path, target: Path) -> tuple[Path, Account]:
    """Write the tensors of the text tower in safetensors."""
    checkpoint = Checkpoint.open(pickled, shown=PICKLED)
    section = checkpoint.whole()
    _check_version(name, {key: section.shape(key) for key in section.names}, pickled, pickled.parent)
    kept = {key: section.take(key).clone() for key in section.names if re.fullmatch(PUBLISHED[name].keep, key)}
    section.ignore(r".*", PUBLISHED[name].left)
    save_file(kept, target, metadata={"format": "pt"})
    return target, checkpoint.finish()


def _check_version(name: str, shapes: Mapping[str, tuple[int, ...]], file: Path, source: Path) -> None:
    """Refuse weights of another encoder, of another version or width, or of another number of layers."""
    known = PUBLISHED[name]
    for marker, width in known.markers.items():
        if marker not in shapes:
            raise InvalidFile(f"is not {name}: lacks {marker}", where=str(file), hint=_hint(name, shapes))
        if shapes[marker][-1] != width:
            raise InvalidFile(
                f"is not {name}: {marker} has shape {shapes[marker]}, not {width} columns",
                where=str(file),
                hint=_hint(name, shapes),
            )
    layers: Any = read_config(source)
    for field in known.layers:
        layers = layers.get(field, layers) if isinstance(layers, Mapping) else layers
    found = {int(match[1]) for key in shapes if (match := re.match(known.blocks, key))}
    if found != set(range(layers if isinstance(layers, int) else 0)):
        raise InvalidFile(
            f"has {len(found)} layers, and its config.json names {layers}",
            where=str(file),
            hint=f"Take all files from {HUB[name]}.",
        )


def _hint(name: str, shapes: Mapping[str, tuple[int, ...]]) -> str:
    """Return the hint, which names the encoder that the tensors belong to where that is a known one."""
    fitting = [
        other
        for other, published in PUBLISHED.items()
        if all(shapes.get(marker, (0,))[-1] == width for marker, width in published.markers.items())
    ]
    other = f" These are weights like those of {HUB[fitting[0]]}, another model." if fitting else ""
    return f"It needs the files of {HUB[name]}.{other}"


def _opened(file: Path) -> Any:
    try:
        return safe_open(file, framework="pt")
    except (SafetensorError, OSError) as error:
        raise InvalidFile(f"cannot be read: {error}", where=str(file), hint="Download the file again.") from None


def _check_finite(name: str, value: Tensor, file: Path) -> None:
    if value.is_floating_point() and not bool(torch.isfinite(value).all()):
        raise InvalidFile(f"{name} holds NaN or infinite numbers", where=str(file), hint="Download the file again.")


def _tokenizer(name: str, source: Path, temporary: Path) -> dict[str, Any]:
    """Return the JSON files of the tokenizer, made of older files where the folder has no `tokenizer.json`."""
    found = {file: read_json(source / file) for file in TOKENIZER_FILES if (source / file).is_file()}
    if TOKENIZER in found:
        return found
    try:
        if (source / SENTENCEPIECE).is_file():
            return {**found, TOKENIZER: _of_sentencepiece(source / SENTENCEPIECE)}
        if all((source / file).is_file() for file in PAIRS):
            return _of_pairs(source, temporary / "tokenizer")
    except Exception as error:  # the libraries raise everything from OSError to bare Exception
        reason = (str(error) or type(error).__name__).splitlines()[0][:200]
        raise InvalidFile(
            f"has no {TOKENIZER}, and its tokenizer cannot be converted: {reason}",
            where=str(source),
            hint=f"Take all files from {HUB[name]}.",
        ) from None
    raise NotFound(
        f"the tokenizer is missing: there is no {TOKENIZER}, {SENTENCEPIECE} or {' with '.join(PAIRS)}",
        where=str(source),
        hint=f"Take all files from {HUB[name]}.",
    )


def _of_sentencepiece(file: Path) -> Any:
    """Return the `tokenizer.json` of T5's vocabulary in the format of SentencePiece, whose library is not needed."""
    from transformers.convert_slow_tokenizer import T5Converter

    known = SimpleNamespace(vocab_file=str(file), _extra_ids=EXTRA_IDS)
    converter: Any = T5Converter(known)
    known.convert_tokens_to_ids = [piece.piece for piece in converter.proto.pieces].index
    return json.loads(converter.converted().to_str())


def _of_pairs(source: Path, folder: Path) -> dict[str, Any]:
    """Return the JSON files of a tokenizer of byte pairs."""
    from transformers import CLIPTokenizer

    CLIPTokenizer.from_pretrained(source, local_files_only=True).save_pretrained(folder)
    return {file: read_json(folder / file) for file in TOKENIZER_FILES if (folder / file).is_file()}


def _try(name: str, folder: Path, source: Path) -> None:
    """Load the written encoder and encode sentences, which an empty vocabulary does not tell apart."""
    try:
        encoder = load_encoder(name, folder)
        first, other = (encoder.encode(sentence).tokens for sentence in SENTENCES)
    except InvalidFile as error:
        raise InvalidFile(error.message, where=str(source), hint=error.hint) from error
    if not np.isfinite(first).all() or (first.shape == other.shape and np.allclose(first, other)):
        raise InvalidFile(
            "its tokenizer and weights encode no sentence", where=str(source), hint=f"Take all files from {HUB[name]}."
        )


CARD = """# Text encoder {name}

The weights of `{hub}` ({credit}) in the layout of the models' hub, imported by `marey models import {name}` from
`{account.file}` ({account.bytes:,} bytes, sha256 `{account.sha256}`). Bundles name it by the sha256 of
`model.safetensors`.
"""
