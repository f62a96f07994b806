"""The key of a prompt's features, computed without loading a model: the API asks for it at submit."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from marey.bundles import TextSpec, find_bundle
from marey.core.errors import InvalidBundle
from marey.core.settings import Settings, settings
from marey.text.action_reader import reader_sha256
from marey.text.order_reader import order_reader_sha256
from marey.text.plain_action import VERSION as PLAIN_ACTION_VERSION
from marey.text.reading_encoder import reading_encoder_sha256
from marey.text.sequence_reader import VERSION as SEQUENCE_VERSION
from marey.text.sequence_reader import sequence_reader_sha256
from marey.vocabulary.bearings import bearings_sha256
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import VERSION, ActionLists

PIPELINE_VERSION = 6
"""Raise it when the graph, the actions or the features of the same prompt change for any reason but weights."""
REWRITER_VERSIONS = {"none": 1, "rules": 1, "openai": 2, "tca": 2}
ASKING = frozenset({"openai", "tca"})
"""Rewriters that ask a language model."""
LABELLER_BUNDLES = {"light": "srl-light", "bert-srl": "srl-bert"}
MEANING_VERSION = 4
"""Raise it when `marey.text.meaning` judges the same prompt otherwise for any reason but the vocabulary."""
NO_LABELLER = "none"
"""A spec may say so: graphs are the motion node alone."""


def feature_key(prompt: str, spec: TextSpec) -> str:
    """sha256 over the prompt and everything its features depend on, each with version or weights hash.

    Args:
        prompt: as `check_prompt` returns it.
        spec: with both hashes (`resolve` fills them).

    Raises:
        InvalidBundle: a hash is missing.
    """
    if spec.encoder_sha256 is None or (spec.labeller_sha256 is None and spec.labeller != NO_LABELLER):
        raise InvalidBundle(
            "the bundle does not say which encoder and labeller weights it was trained with",
            hint="Resolve its text specification first (marey.text.keys.resolve).",
        )
    parts = [
        PIPELINE_VERSION,
        prompt,
        _rewriter_parts(spec),
        [spec.labeller, spec.labeller_sha256],
        [spec.encoder, spec.encoder_sha256, spec.width, spec.node_features],
        [spec.max_actions, spec.max_specifics, spec.in_order],
    ]
    if spec.plain_action:
        words = [load_vocabulary().sha256, bearings_sha256()]
        parts.append(["plain_action", PLAIN_ACTION_VERSION, *words, reader_sha256(), reading_encoder_sha256()])
    if spec.movements:
        readers = [sequence_reader_sha256(), order_reader_sha256()]
        parts.append(["movements", SEQUENCE_VERSION, load_vocabulary().sha256, *readers])
    return hashlib.sha256(json.dumps(parts, ensure_ascii=False).encode()).hexdigest()


def _rewriter_parts(spec: TextSpec) -> list[Any]:
    parts: list[Any] = [spec.rewriter, REWRITER_VERSIONS[spec.rewriter]]
    if spec.rewriter_model:
        parts.append(spec.rewriter_model)
    if spec.rewriter in ASKING and spec.wording != "caption":
        parts.append(spec.wording)
    if spec.rewriter in ASKING and spec.style:
        parts.append(["style", *spec.style])
    if spec.rewriter == "tca":
        parts.append(load_vocabulary().sha256)
    return parts


def scope_key(prompt: str, bundle: str, lists: ActionLists, *, in_rows: bool = False, of_edit: bool = False) -> str:
    """Return the key under which the encoder's verdict of a prompt is stored.

    Args:
        prompt: as `check_prompt` returns it.
        bundle: the exact bundle, which names the encoder.
        lists: its actions.
        in_rows: the prompt is the text form of a timeline, whose rows are judged one by one.
        of_edit: the prompt is the lines of the prompts of an edit, which are judged one by one.
    """
    actions = [lists.supported, lists.single_take, lists.tried]
    parts = [VERSION, MEANING_VERSION, load_vocabulary().sha256, bundle, actions, prompt]
    parts += [bearings_sha256()] if lists.drawn else []
    parts += ["rows"] if in_rows else ["edit"] if of_edit else []
    return hashlib.sha256(json.dumps(parts, ensure_ascii=False).encode()).hexdigest()


def as_served(spec: TextSpec, *, config: Settings | None = None) -> TextSpec:
    """Text pipeline of a bundle on this machine: `MAREY_REWRITER` replaces the bundle's rewriter."""
    config = config or settings()
    if config.rewriter is None:
        return spec
    model = config.rewriter_model if config.rewriter in ASKING else None
    return spec.model_copy(update={"rewriter": config.rewriter, "rewriter_model": model})


def resolve(spec: TextSpec, *, config: Settings | None = None) -> TextSpec:
    """`spec` with the hashes it leaves open filled from the weights on this machine. Loads no model.

    Raises:
        NotFound: weights whose hash is needed are not installed.
    """
    changes: dict[str, str] = {}
    if spec.encoder_sha256 is None:
        from marey.text.encoders import encoder_sha256

        changes["encoder_sha256"] = encoder_sha256(spec.encoder, config=config)
    if spec.labeller_sha256 is None and spec.labeller != NO_LABELLER:
        bundle = find_bundle(labeller_bundle(spec.labeller), config=config, verify=False)
        changes["labeller_sha256"] = bundle.weights_sha256
    return spec.model_copy(update=changes)


def labeller_bundle(name: str) -> str:
    """The bundle of a labeller: `light` is `srl-light`; anything else is a bundle's own name or path."""
    return LABELLER_BUNDLES.get(name, name)
