"""The report of a tokenizer alone: real motion beside its reconstruction."""

from __future__ import annotations

from datetime import UTC, datetime

import torch

from marey.core.package import own_version
from marey.data.prepared import PreparedData
from marey.evaluations import COMPOSITIONAL, TEST_SPLIT
from marey.evaluator.port import Evaluator
from marey.evaluator.reconstruction import Rebuilt
from marey.evaluator.reference import RealClips
from marey.evaluator.report import ArtifactReference, Repeats, Report
from marey.evaluator.report.model import RECONSTRUCTION
from marey.evaluator.reporting import bundle_of
from marey.evaluator.rows import Ruler, reconstruction_row, truth_row
from marey.evaluator.scoring import REPEATS, metrics_of


def tokenizer_report(
    rebuilt: Rebuilt, evaluator: Evaluator, real: RealClips, data: PreparedData, *, licence: str
) -> Report:
    """Build a report whose judged row is the reconstruction of every test and compositional clip.

    Args:
        rebuilt: the measurements.
        evaluator: the evaluator that measured.
        real: the clips.
        data: the prepared folder of the clips.
        licence: of the tokenizer's weights.
    """
    found = rebuilt.reconstruction
    splits = tuple(name for name in (TEST_SPLIT, COMPOSITIONAL) if name in real.splits)
    source = "+".join(splits)
    ruler = Ruler(evaluator, real, splits, seed=0)
    clips = found.clips[source]
    return Report(
        title=f"The tokenizer of {found.generator.partition('@')[0]} alone",
        evaluation="reconstruction",
        created=datetime.now(UTC),
        generator=bundle_of(found.generator),
        licence=licence,
        evaluator=bundle_of(evaluator.name),
        source=ArtifactReference(source, data.manifest.files["features.npy"].sha256),
        prompts=clips,
        motions=clips,
        repeats=Repeats(REPEATS, 0),
        metrics=metrics_of(evaluator, splits),
        rows=(truth_row(ruler), reconstruction_row(found.values[source], found.note(source))),
        judged=RECONSTRUCTION,
        heat=rebuilt.heat,
        command=f"marey train evaluator reconstruct {evaluator.name} {found.generator} DATA",
        software={"marey": own_version(), "torch": torch.__version__},
        notes=tuple(f"Mean joint error on {name}: {error:.1f} mm" for name, error in found.error_mm.items()),
    )
