"""From the parts of a run to a bundle: what is the same for all generators."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from shared.bundles import DataSource, TextSpec
from workers.training.data.prepared import PreparedData
from workers.training.parts import Part
from workers.training.staging import ModelConfig, Recipe
from workers.training.texts import CaptionTexts

REPOSITORY = Path(__file__).resolve().parents[2]

C = TypeVar("C", bound=ModelConfig)


@dataclass(frozen=True)
class Gathered:
    """Finished parts, and what the manifest says of how they were made."""

    parts: dict[str, Part]
    text: TextSpec
    manifest: dict[str, Any]


def gather(prepared: Path, run: Path, recipe: Recipe[C], config: C) -> Gathered:
    """All parts of a run.

    Raises:
        NotFound: a stage has not finished.
        InvalidInput: parts of different configurations.
    """
    data = PreparedData.open(prepared)
    parts = {name: recipe.part(name, config, run) for name in recipe.stages}
    sources = data.manifest.sources
    sha256 = data.manifest.files["features.npy"].sha256
    manifest = {
        "licence": _terms(sorted({source.licence for source in sources})),
        "data": tuple(DataSource(name=s.name, licence=s.licence, credit=s.credit, sha256=sha256) for s in sources),
        "metrics": {f"{stage}/{k}": v for stage, part in parts.items() for k, v in part.metrics.items()},
        "training": {"commit": _commit(), "budgets": {name: part.budget for name, part in parts.items()}},
    }
    return Gathered(parts, CaptionTexts.load(data).spec, manifest)


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
