"""The manifest of a bundle (`manifest.json`)."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    field_serializer,
    field_validator,
    model_serializer,
    model_validator,
)

from marey.core.documents import parse_json
from marey.core.errors import InvalidBundle
from marey.core.validation import place_of, problem_of, worded
from marey.vocabulary.scope import ActionLists

FORMAT = 2
"""Format of new bundles. Format 1, whose hash covers the files alone, is still read with the same hash."""
MANIFEST_NAME = "manifest.json"
DESCRIPTIVE = {"name", "version", "metrics", "training", "actions"}
"""Fields that only describe a bundle: format 2 hashes all others."""
SHARD_ENDING = ".safetensors"
RESERVED = frozenset({MANIFEST_NAME, "readme.md"})
"""The manifest has no hash of itself, and the card may be edited."""
NON_COMMERCIAL = re.compile(r"(^|[-_ ])NC($|[-_ ])", re.IGNORECASE)
"""Matches SPDX names of non-commercial terms, such as CC-BY-NC-4.0."""

MAX_PROBLEMS = 1000  # characters

Sha256 = Annotated[str, Field(pattern=worded(r"^[0-9a-f]{64}$", "64 digits of hexadecimal numbers"))]
PlainName = Annotated[
    str,
    Field(
        pattern=worded(
            r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$",
            "letters from A to Z, digits, `.`, `_` and `-`, at most 100, of which the first is a letter or digit",
        )
    ),
]
"""A file or bundle name that cannot leave its folder."""
MAX_STYLE = 64
StyleCaption = Annotated[
    str, Field(max_length=500, pattern=worded(r"^\S[^\r\n]*$", "one line that begins with a word"))
]
"""A training caption that language models are shown."""


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class BundleFile(_Frozen):
    """One file of the bundle."""

    sha256: Sha256
    bytes: int = Field(ge=0)


class DataSource(_Frozen):
    """A data set that the weights were trained on."""

    name: str
    licence: str
    credit: str
    sha256: Sha256 | None = None
    """Hash of the prepared data's manifest."""


class TextSpec(_Frozen):
    """The text pipeline of a bundle: fixed at training, refused when a component differs."""

    encoder: Literal["minilm", "clip-vit-b32", "clip-vit-l14", "t5-base", "t5-v1_1-base", "distilbert-base-uncased"] = (
        "minilm"
    )
    encoder_sha256: Sha256 | None = None
    width: int = Field(default=384, ge=1)
    labeller: str = "light"
    labeller_sha256: Sha256 | None = None
    rewriter: Literal["none", "rules", "openai", "tca"] = "none"
    rewriter_model: str | None = None
    """The language model of `openai` and `tca`."""
    node_features: Literal["pooled", "span"] = "pooled"
    max_actions: int = Field(default=8, ge=1)
    max_specifics: int = Field(default=16, ge=1)
    in_order: bool = False
    """Ours: a prompt of several actions is read as its actions in order ("before bowing, she walks" as "she walks, and
    then a person is bowing")."""
    plain_action: bool = False
    """Ours: the one action that a prompt asks for is said first in plain words ("The waiter takes a bow" is read as
    "a person bows, the waiter takes a bow")."""
    movements: bool = False
    """Ours: of a prompt of several actions, one after the other, each is also read by itself, in the order of time; a
    model that generates around other frames makes each of them as a motion of its own, and the ways between them. Needs
    `plain_action`."""
    split_actions: bool = True
    """Ours: a model that draws action after action reads each action of a prompt by itself; else the sentence alone."""

    wording: Literal["caption", "description"] = "caption"
    """Texts that the model was trained on, in whose wording a language model rewrites: captions of one sentence, or
    descriptions of about 60 words (SnapMoGen)."""
    style: tuple[StyleCaption, ...] = Field(default=(), max_length=MAX_STYLE)
    """Captions of the training data that a language model is shown for `caption`; none = those of the starter
    bundles (MOGO's TCA, Sec. 2.3)."""

    @model_validator(mode="after")
    def _check_movements(self) -> Self:
        if self.movements and not self.plain_action:
            raise ValueError("movements needs plain_action")
        return self

    @model_serializer(mode="wrap")
    def _serialize(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave fields out that have the usual value: earlier releases refuse a field that they do not know."""
        values: dict[str, Any] = handler(self)
        if not self.plain_action:
            values.pop("plain_action", None)
        if not self.movements:
            values.pop("movements", None)
        if self.split_actions:
            values.pop("split_actions", None)
        if self.wording == "caption":
            values.pop("wording", None)
        if not self.style:
            values.pop("style", None)
        return values


class BundleManifest(_Frozen):
    """The manifest of a bundle, validated on loading."""

    format: Literal[1, 2] = 1
    name: PlainName
    version: str
    kind: Literal["generator", "labeller", "evaluator", "encoder"]
    model: str
    """Model that reads it: `hgm3`, `light`, …"""
    config: str
    """Name of the configuration: `paper`, `starter`, `tiny`, …"""
    parameters: dict[str, Any]
    """The complete configuration: the network is built from it, not from the name."""
    random: bool = False
    """True = weights were never trained; such a bundle is for tests and demos."""
    skeleton: str | None = None
    offsets: tuple[tuple[float, float, float], ...] | None = None
    """(J, 3) metres: the T-pose of the training data's body. None = that of Marey's skeleton of this name."""
    layout: str | None = None
    fps: float | None = None
    text: TextSpec | None = None
    data: tuple[DataSource, ...] = ()
    licence: str
    """Terms of the weights (SPDX)."""
    metrics: dict[str, float] = {}
    training: dict[str, Any] = {}
    """Provenance: commit, commands, budgets and data hash."""
    actions: ActionLists | None = None
    """Actions that a generator supports and those that it was trained on in vain, measured; None = not measured."""
    parts: dict[PlainName, tuple[PlainName, ...]]
    """Shards of each part, in order."""
    files: dict[PlainName, BundleFile]

    @field_validator("files")
    @classmethod
    def _only_data_files(cls, files: dict[str, BundleFile]) -> dict[str, BundleFile]:
        foreign = [name for name in files if not name.endswith((".safetensors", ".json", ".md"))]
        if foreign:
            raise ValueError(f"a bundle holds safetensors, JSON and Markdown only, not {', '.join(foreign)}")
        return files

    @model_validator(mode="after")
    def _hashed_parts(self) -> BundleManifest:
        """Check that every shard is a file with a hash, and that format 2 has no ambiguous names."""
        shards = [shard for part in self.parts.values() for shard in part]
        missing = sorted({shard for shard in shards if shard not in self.files})
        if missing:
            raise ValueError(f"parts name shards that are not in `files`, without a hash: {', '.join(missing[:3])}")
        if self.format == 1:
            return self
        if foreign := [shard for shard in shards if not shard.endswith(SHARD_ENDING)]:
            raise ValueError(f"parts are safetensors, not {foreign[0]}")
        if empty := [name for name, part in self.parts.items() if not part]:
            raise ValueError(f"the part {empty[0]!r} has no shards")
        if len(set(shards)) < len(shards):
            raise ValueError("a shard is listed twice")
        if len({name.casefold() for name in self.files}) < len(self.files):
            raise ValueError("two files have names that differ in case alone")
        if reserved := [name for name in self.files if name.casefold() in RESERVED]:
            raise ValueError(f"{reserved[0]} cannot be a file with a hash")
        return self

    @property
    def draws_bearings(self) -> bool:
        """Return True if bearings are drawn: where prompts are read behind their plain action, without these words."""
        return self.text is not None and self.text.plain_action

    @model_validator(mode="after")
    def _with_bearings(self) -> Self:
        """Say in the lists of actions whether bearings are drawn."""
        if self.actions is not None:
            object.__setattr__(self, "actions", replace(self.actions, drawn=self.draws_bearings))
        return self

    @field_serializer("actions", mode="wrap")
    def _lists_alone(self, actions: ActionLists | None, handler: SerializerFunctionWrapHandler) -> Any:
        """Leave out what is no part of the lists: `text` says whether bearings are drawn."""
        values = handler(actions)
        return values if values is None else {name: value for name, value in values.items() if name != "drawn"}

    @property
    def commercial(self) -> bool:
        """True if the terms of the weights allow commercial use."""
        return NON_COMMERCIAL.search(self.licence) is None


def parse_manifest(data: bytes, where: str, *, hint: str | None = None) -> BundleManifest:
    """Read the manifest of a bundle.

    Raises:
        InvalidBundle: not JSON, or not a manifest that this version reads.
    """
    document = parse_json(data, where, error=InvalidBundle, hint=hint)
    try:
        return BundleManifest.model_validate(document)
    except ValidationError as error:
        found = error.errors(include_input=False, include_url=False)
        problems = "; ".join(f"{place_of(each) or 'file'}: {problem_of(each)}" for each in found[:5])
        raise InvalidBundle(
            f"is not a manifest this version reads: {problems[:MAX_PROBLEMS]}", where=where, hint=hint
        ) from None
