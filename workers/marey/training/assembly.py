"""Assemble a bundle from the parts of a run: the code shared by all generators."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from torch import Tensor

from marey.bundles import Bundle, DataSource, TextSpec
from marey.core.checkout import checkout
from marey.core.errors import InvalidInput
from marey.data.licences import Terms, check_mix
from marey.data.prepared import PreparedData
from marey.data.style import style_of
from marey.nn.bundling import GeneratorConfig, write_generator
from marey.training.parts import TrainedPart, save_part
from marey.training.staging import TrainableConfig, TrainingRecipe, bundle_terms
from marey.training.texts import CaptionTexts

C = TypeVar("C", bound=TrainableConfig)


@dataclass(frozen=True)
class Gathered:
    """Finished parts, and the manifest's record of their training."""

    parts: dict[str, TrainedPart]
    text: TextSpec
    manifest: dict[str, Any]

    def write(
        self,
        path: Path,
        model: str,
        config: GeneratorConfig,
        *,
        states: Mapping[str, Mapping[str, Tensor]] | None = None,
        text: TextSpec | None = None,
        card: str | None = None,
        overwrite: bool = False,
    ) -> Bundle:
        """Write the bundle of a generator; its statistics are those of the part `tokenizer`.

        Args:
            path: the bundle's folder.
            model: name of the model that reads it.
            config: configuration of the networks.
            states: state dict of each part of the bundle; None = those of the parts of the run.
            text: encoder, labeller and caps; None = those of the captions.
            card: the model card.
            overwrite: replace an existing bundle.
        """
        states = {name: part.state for name, part in self.parts.items()} if states is None else states
        tokenizer = dict(states["tokenizer"])
        statistics = (tokenizer.pop("mean").numpy(), tokenizer.pop("std").numpy())
        return write_generator(
            path, model, config, {**states, "tokenizer": tokenizer}, statistics,
            text=text or self.text, card=card, overwrite=overwrite, **self.manifest,
        )  # fmt: skip


def gather(prepared: Path, run: Path, recipe: TrainingRecipe[C], config: C) -> Gathered:
    """Read all parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    data = PreparedData.open(prepared)
    parts = {name: recipe.part(name, config, run) for name in recipe.stages}
    sha256 = data.manifest.files["features.npy"].sha256
    sources = {(terms.name, terms.licence): terms for terms in data.manifest.terms}
    for part in parts.values():
        for terms in part.sources:
            sources.setdefault((terms.name, terms.licence), terms)
    manifest = {
        "licence": _terms(tuple(sources.values())),
        "data": tuple(
            DataSource(name=s.name, licence=s.licence, credit=s.credit, sha256=sha256) for s in sources.values()
        ),
        "metrics": {f"{stage}/{k}": v for stage, part in parts.items() for k, v in part.metrics.items()},
        "training": {"commit": _commit(), "budgets": {name: part.budget for name, part in parts.items()}},
    }
    spec = CaptionTexts.load(data).spec.model_copy(update={"style": style_of(data.split("train"))})
    return Gathered(parts, spec, manifest)


def scatter(
    bundle: Bundle, run: Path, recipe: TrainingRecipe[C], states: Mapping[str, Mapping[str, Tensor]], config: C
) -> None:
    """Write a part for each stage's state dict into a run folder, as if the stages had just finished there.

    State of the `tokenizer` that a bundle lacks is reconstructed: the moving sums of the codebooks are their codes.

    Raises:
        InvalidInput: the run has parts already.
    """
    present = [name for name in recipe.stages if (run / name).exists()]
    if present:
        raise InvalidInput(
            f"already has a stage {present[0]}", where=str(run), hint="Unpack the bundle into a new folder."
        )
    manifest = bundle.manifest
    data_sha256 = (manifest.data[0].sha256 or "") if manifest.data else ""
    sources = bundle_terms(bundle)
    for name, state in states.items():
        state = dict(state)
        if "quantizer.sums" in state:
            state["quantizer.sums"] = state["quantizer.codebooks"] * state["quantizer.counts"][..., None]
        metrics = {k.removeprefix(f"{name}/"): v for k, v in manifest.metrics.items() if k.startswith(f"{name}/")}
        part = TrainedPart(state, config.to_dict(), metrics, data_sha256, {"bundle": bundle.reference}, sources)
        save_part(run / name / "part", part)


def _terms(sources: Sequence[Terms]) -> str:
    """Terms of weights trained on all of these, as an SPDX name: the strictest. Of several that ask for credit at most
    it is CC BY, so that the credit goes along."""
    tier, licences = check_mix(sources), {terms.licence for terms in sources}
    if tier == "commercial" and len(licences) == 1:
        return licences.pop()
    return {"commercial": "CC-BY-4.0", "sharealike": "CC-BY-SA-4.0", "non-commercial": "CC-BY-NC-4.0"}[tier]


def _commit() -> str | None:
    """Return the commit of the checkout; None for an installed wheel, whatever repository contains its environment."""
    root = checkout()
    if root is None:
        return None
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=True, timeout=10
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()
