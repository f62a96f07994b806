"""From the parts of a run to a bundle, and back: the parts of a bundle as a run that training goes on from."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from torch import Tensor

from shared.bundles import Bundle, DataSource
from shared.errors import InvalidInput
from workers.hgm3.bundle import load_networks, write_bundle
from workers.hgm3.config import HGM3Config
from workers.training.data.prepared import PreparedData
from workers.training.parts import Part, save_part
from workers.training.staging import Recipe
from workers.training.texts import CaptionTexts

T = TypeVar("T")

RECIPE = Recipe(
    read=HGM3Config.from_dict,
    built_from={
        "tokenizer": ("layout", "features", "joints", "tokenizer"),
        "masked": ("tokenizer", "condition", "compact", "max_frames", "masked", "predictor"),
        "residual": ("tokenizer", "condition", "compact", "max_frames", "residual"),
        "length": ("condition", "max_frames", "length_hidden"),
    },
    shares={"tokenizer": 0.42, "masked": 0.38, "residual": 0.18, "length": 0.02},
    most_steps={"length": 1000},  # beyond them validation loss rises again (3.17 → 3.52)
)
REPOSITORY = Path(__file__).resolve().parents[2]


def assemble(
    prepared: Path, run: Path, bundle: Path, config: HGM3Config, *, card: str | None = None, overwrite: bool = False
) -> Bundle:
    """Write the bundle from the parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    data = PreparedData.open(prepared)
    parts = {name: RECIPE.part(name, config, run) for name in RECIPE.stages}
    masked = parts["masked"].state
    states = {
        "tokenizer": dict(parts["tokenizer"].state),
        "masked": _under(masked, "masked."),
        "predictor": _under(masked, "teacher."),
        "residual": parts["residual"].state,
        "length": parts["length"].state,
    }
    statistics = (states["tokenizer"].pop("mean").numpy(), states["tokenizer"].pop("std").numpy())
    metrics = {f"{stage}/{k}": v for stage, part in parts.items() for k, v in part.metrics.items()}
    sha256 = data.manifest.files  # the data's own hashes
    licences = sorted({source.licence for source in data.manifest.sources})
    sources = tuple(
        DataSource(name=s.name, licence=s.licence, credit=s.credit, sha256=sha256["features.npy"].sha256)
        for s in data.manifest.sources
    )
    return write_bundle(
        bundle,
        config,
        states,
        statistics,
        text=CaptionTexts.load(data).spec,
        card=card,
        overwrite=overwrite,
        licence=_terms(licences),
        data=sources,
        metrics=metrics,
        training={"commit": _commit(), "budgets": {name: part.budget for name, part in parts.items()}},
    )


def take_apart(bundle: Bundle, run: Path) -> HGM3Config:
    """Write the parts of a bundle into a run folder, as if its stages had just finished there.

    What a bundle does not hold is made up as well as can be: the predictor starts as its teacher, the moving sums of
    the codebooks as their codes. Returns the bundle's configuration.

    Raises:
        InvalidInput: the run has parts already.
        InvalidBundle: of another model, or damaged.
    """
    config, networks = load_networks(bundle)
    present = [name for name in RECIPE.stages if (run / name).exists()]
    if present:
        raise InvalidInput(
            f"has a stage {present[0]} already", where=str(run), hint="Take the bundle apart into a new folder."
        )
    tokenizer = networks.tokenizer.state_dict()
    tokenizer["quantizer.sums"] = tokenizer["quantizer.codebooks"] * tokenizer["quantizer.counts"][..., None]
    predictor = networks.predictor.state_dict()
    states = {
        "tokenizer": tokenizer,
        "masked": _over(networks.masked.state_dict(), "masked.")
        | _over(predictor, "predictor.")
        | _over(predictor, "teacher."),
        "residual": networks.residual.state_dict(),
        "length": networks.length.state_dict(),
    }
    manifest = bundle.manifest
    data_sha256 = (manifest.data[0].sha256 or "") if manifest.data else ""
    origin = {"bundle": bundle.reference}
    for name, state in states.items():
        metrics = _under(manifest.metrics, f"{name}/")
        save_part(run / name / "part", Part(state, config.to_dict(), metrics, data_sha256, origin))
    return config


def _under(state: Mapping[str, T], prefix: str) -> dict[str, T]:
    return {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}


def _over(state: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {prefix + name: value for name, value in state.items()}


def _terms(licences: Sequence[str]) -> str:
    """The strictest terms of the sources, as an SPDX name."""
    return "CC-BY-NC-4.0" if any("NC" in licence for licence in licences) else licences[0]


def _commit() -> str | None:
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=REPOSITORY, capture_output=True, text=True, check=True, timeout=10
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()
