"""What a bundle says of itself (`manifest.json`)."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

FORMAT = 1
MANIFEST_NAME = "manifest.json"
NON_COMMERCIAL = re.compile(r"(^|[-_ ])NC($|[-_ ])", re.IGNORECASE)
"""Matches SPDX names of non-commercial terms, such as CC-BY-NC-4.0."""

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
PlainName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$")]
"""A file or bundle name that cannot leave its folder."""


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class FileEntry(_Frozen):
    """One file of the bundle."""

    sha256: Sha256
    bytes: int = Field(ge=0)


class DataSource(_Frozen):
    """What the weights were trained on."""

    name: str
    licence: str
    credit: str
    sha256: Sha256 | None = None
    """Hash of the prepared data's manifest."""


class TextSpec(_Frozen):
    """How prompts become features for this bundle: fixed at training, refused when anything differs."""

    encoder: Literal["minilm", "clip-vit-b32", "t5-base", "t5-v1_1-base"] = "minilm"
    encoder_sha256: Sha256 | None = None
    width: int = Field(default=384, ge=1)
    labeller: str = "light"
    labeller_sha256: Sha256 | None = None
    rewriter: Literal["none", "rules", "openai"] = "none"
    rewriter_model: str | None = None
    """The language model of `openai`."""
    node_features: Literal["pooled", "span"] = "pooled"
    max_actions: int = Field(default=8, ge=1)
    max_specifics: int = Field(default=16, ge=1)
    in_order: bool = False
    """Ours: a prompt of several acts is read as these acts, one after the other ("before bowing, she walks" as "she
    walks, and then a person is bowing")."""


class BundleManifest(_Frozen):
    """The manifest of a bundle, validated on loading."""

    format: Literal[1] = FORMAT
    name: PlainName
    version: str
    kind: Literal["generator", "labeller", "evaluator"]
    model: str
    """Which network reads it: `hgm3`, `mogo`, `momaskpp`, `light`, …"""
    config: str
    """Name of the configuration: `paper`, `starter`, `tiny`, …"""
    parameters: dict[str, Any]
    """The configuration itself, whole: the network is built from this, not from the name."""
    random: bool = False
    """Weights were never trained; such a bundle only exercises the machinery."""
    skeleton: str | None = None
    layout: str | None = None
    fps: float | None = None
    text: TextSpec | None = None
    data: tuple[DataSource, ...] = ()
    licence: str
    """Terms of the weights (SPDX)."""
    metrics: dict[str, float] = {}
    training: dict[str, Any] = {}
    """Commit, commands, budgets and data hash: what made it."""
    parts: dict[PlainName, tuple[PlainName, ...]]
    """Shards of each part, in order."""
    files: dict[PlainName, FileEntry]

    @field_validator("files")
    @classmethod
    def _only_data_files(cls, files: dict[str, FileEntry]) -> dict[str, FileEntry]:
        foreign = [name for name in files if not name.endswith((".safetensors", ".json", ".md"))]
        if foreign:
            raise ValueError(f"a bundle holds safetensors, JSON and Markdown only, not {', '.join(foreign)}")
        return files

    @property
    def commercial(self) -> bool:
        """Whether the terms of the weights allow commercial use."""
        return NON_COMMERCIAL.search(self.licence) is None
