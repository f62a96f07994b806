"""The bundle of MiniLM: all-MiniLM-L6-v2 with the matrices of embeddings and layers in 8 bits
(`marey.bundles.eight_bit`)."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file  # pyright: ignore[reportUnknownVariableType]
from tokenizers import Tokenizer
from torch import Tensor

from marey.bundles import Bundle, BundleWriter, DataSource
from marey.bundles.eight_bit import quantize, restore, scale_of
from marey.core.documents import read_json
from marey.core.errors import InvalidBundle, InvalidFile

WIDTH = 384
LAYERS = 6
PART = "encoder"
TOKENIZER = "tokenizer.json"
SOURCE = "sentence-transformers/all-MiniLM-L6-v2"
SOURCE_SHA256 = "53aa51172d142c89d9012cce15ae4d6cc0ca6895895114379cacb4fab128d9db"
"""Of its `model.safetensors`, in float32."""
MATRIX = re.compile(r"(embeddings\.word_embeddings|encoder\..*(query|key|value|dense))\.weight")
UNUSED = ("pooler.", "embeddings.position_ids")

Arrays = dict[str, NDArray[np.generic]]


def load_weights(bundle: Bundle) -> dict[str, Tensor]:
    """The tensors of the encoder in float32, by the names of BERT.

    Raises:
        InvalidBundle: the bundle is damaged, or does not hold six layers of width 384.
    """
    restored = restore(bundle.tensors(PART), where=str(bundle.path))
    weights = {name: torch.as_tensor(np.require(value, np.float32, "W")) for name, value in restored.items()}
    _check(weights, bundle.path)
    return weights


def load_tokenizer(bundle: Bundle) -> Tokenizer:
    """The tokenizer of the bundle, without padding and truncation.

    Raises:
        InvalidBundle: it is missing or foreign.
    """
    content = bundle.read_file(TOKENIZER)
    try:
        tokenizer = Tokenizer.from_str(content.decode())
    except Exception as error:  # the library raises bare Exception
        raise InvalidBundle(f"is not a tokenizer: {error}", where=str(bundle.path / TOKENIZER)) from error
    tokenizer.no_padding()
    tokenizer.no_truncation()
    return tokenizer


def import_minilm(folder: Path, output: Path) -> Bundle:
    """Write the bundle of MiniLM from the published weights.

    Args:
        folder: `model.safetensors` and `tokenizer.json` of `SOURCE`.
        output: the bundle's folder.

    Raises:
        InvalidFile: the folder holds something else.
    """
    file = folder / "model.safetensors"
    try:
        found = hashlib.sha256(file.read_bytes()).hexdigest()
        if found != SOURCE_SHA256:
            raise InvalidFile(f"is not the file of {SOURCE}: its sha256 is {found[:12]}", where=str(file))
        weights = load_file(file)
    except (SafetensorError, OSError) as error:
        raise InvalidFile(f"cannot be read: {error}", where=str(file), hint=f"It needs {SOURCE}.") from error
    tokenizer = read_json(folder / TOKENIZER, hint=f"It needs {SOURCE}.")
    with BundleWriter(output, overwrite=True) as writer:
        writer.add_part(PART, quantized(weights), dtype=None)
        writer.add_json(TOKENIZER, tokenizer)
        writer.add_card(CARD.format(source=SOURCE, sha256=SOURCE_SHA256))
        return writer.finish(
            name=output.name,
            version="1",
            kind="encoder",
            model="minilm",
            config="l6",
            parameters={"width": WIDTH, "layers": LAYERS},
            data=(DataSource(name=SOURCE, licence="Apache-2.0", credit=CREDIT, sha256=SOURCE_SHA256),),
            licence="Apache-2.0",
            training={"command": f"python -m marey.text.convert minilm FOLDER -o models/{output.name}"},
        )


def quantized(weights: Mapping[str, NDArray[np.generic]]) -> Arrays:
    """Return the tensors as they are stored: matrices in int8 with scales, positions in float16, vectors in float32.

    Args:
        weights: all tensors of the model, in float32; unused ones are left out.
    """
    kept: Arrays = {}
    for name, value in sorted(weights.items()):
        if name.startswith(UNUSED):
            continue
        if MATRIX.fullmatch(name):
            kept[name], kept[scale_of(name)] = quantize(value.astype(np.float32))
        else:
            kept[name] = value.astype(np.float16 if value.ndim > 1 else np.float32)
    return kept


def _check(weights: Mapping[str, Tensor], where: Path) -> None:
    last = f"encoder.layer.{LAYERS - 1}.output.dense.weight"
    beyond = f"encoder.layer.{LAYERS}.output.dense.weight"
    if last not in weights or weights[last].shape[0] != WIDTH or beyond in weights:
        raise InvalidBundle(f"is not MiniLM: {LAYERS} BERT layers of width {WIDTH} are expected", where=str(where))


CREDIT = (
    "all-MiniLM-L6-v2 by the sentence-transformers project (Reimers & Gurevych 2019), trained from MiniLM-L6-H384-"
    "uncased by N. Reimers after Microsoft's MiniLM (Wang et al. 2020)"
)
CARD = """# minilm-l6: sentence encoder in 8 bits

The text encoder by which Marey reads prompts: all-MiniLM-L6-v2 (six BERT layers, width 384, 30,522 word
pieces). The first 256 tokens of a text are read; the normalised mean of the last states is its vector.

## Terms

Apache-2.0, as the original: {source}, whose `model.safetensors` has the sha256
`{sha256}`.
Reimers & Gurevych 2019 (arXiv 1908.10084), Wang et al. 2020 (arXiv 2002.10957). The original was trained on
a billion public pairs of English sentences, which its own card lists; none of them is here.

Changed by Marey: the matrices of embeddings and layers are in 8 bits, and the pooler, which no sentence vector
needs, is left out.

## Format

A matrix is `<name>.weight` in int8 and `<name>.scale` in float32, one scale a row; position and token type
embeddings are float16, vectors float32. Loaded, all are float32 (`shared/marey/text/minilm_bundle.py`).

## Quality

| against the original in float32 | |
|---|---|
| cosine of sentence vectors, mean of 400 captions | 0.9995 |
| cosine, least of them | 0.9985 |

Half of the captions are of the starter evaluator's clips, half of KIT Motion-Language. Decision 19
(`docs/decisions`) says what the change does to generated motions.

## Limits

English, without case. It knows little of motion: "left hand" and "right hand" have a cosine of 0.9.

## How it was made

    hf download {source} model.safetensors tokenizer.json --local-dir FOLDER
    python -m marey.text.convert minilm FOLDER -o models/minilm-l6
"""
