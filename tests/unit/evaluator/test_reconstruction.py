"""Real clips through a tokenizer: the row of reports that needs the data, and where it is kept."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from torch import Tensor
from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.commands.train import app
from marey.core.errors import InvalidFile, InvalidInput
from marey.data.prepared import PreparedData
from marey.evaluator.assembly import renew_reference
from marey.evaluator.measuring import check
from marey.evaluator.reconstruction import find_reconstruction, reconstruct
from marey.evaluator.reference import RealClips
from marey.evaluator.rows import Ruler, truth_row
from marey.evaluator.tmr import TMREvaluator
from marey.models.hgm3.bundle import random_bundle
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.nn.quantizer import Quantized
from tests.support.prepared import write_prepared

GENERATOR = "perfect@0123456789ab"


class Perfect(MotionTokenizer):
    """Loses nothing: its only token is the clip itself."""

    def __init__(self) -> None:
        super().__init__(263, 4)

    @property
    def codebooks(self) -> Tensor:
        raise NotImplementedError

    def forward(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Quantized]:
        raise NotImplementedError

    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        self.seen = features
        return features[:, ::4, :6].long()

    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        return self.seen


@pytest.fixture
def judge(bundle: Bundle, tmp_path: Path) -> Bundle:
    """A copy of the evaluator, to keep files beside."""
    return Bundle.open(Path(shutil.copytree(bundle.path, tmp_path / "judge")))


def test_a_tokenizer_that_loses_nothing_gives_real_motion_back(
    prepared: PreparedData, real: RealClips, evaluator: TMREvaluator
) -> None:
    found = reconstruct(prepared, real, evaluator, GENERATOR, Perfect()).reconstruction
    values = found.values["test"]
    truth = truth_row(Ruler(evaluator, real, ("test",), seed=0)).values
    assert (found.clips, found.error_mm) == ({"test": 40}, {"test": 0.0})
    assert values["fid"].mean == pytest.approx(0, abs=0.05)  # up to three frames of a clip make no whole token
    assert values["jerk"].mean == pytest.approx(truth["jerk"].mean, rel=0.05)
    assert values["r_precision_3_of_32"].mean == pytest.approx(truth["r_precision_3_of_32"].mean, abs=10)


def test_what_was_measured_is_found_for_exactly_these_two_bundles(
    prepared: PreparedData, real: RealClips, evaluator: TMREvaluator, judge: Bundle, tmp_path: Path
) -> None:
    made = reconstruct(prepared, real, evaluator, GENERATOR, Perfect()).reconstruction
    assert find_reconstruction(judge, GENERATOR) is None
    file = made.save(judge)
    assert find_reconstruction(Bundle.open(judge.path), GENERATOR) == made
    assert find_reconstruction(judge, "perfect@ffffffffffff") is None
    shutil.copy(file, file.with_name("perfect@ffffffffffff.json"))
    with pytest.raises(InvalidFile, match="was measured of perfect@0123456789ab"):
        find_reconstruction(judge, "perfect@ffffffffffff")
    file.write_text("{}")
    with pytest.raises(InvalidFile, match="is not a reconstruction"):
        find_reconstruction(judge, GENERATOR)
    with pytest.raises(InvalidInput, match="not an exact bundle"):
        find_reconstruction(judge, "../x@0123456789ab")


def test_other_motion_under_the_names_of_the_clips_is_refused(
    real: RealClips, evaluator: TMREvaluator, tmp_path: Path
) -> None:
    other = PreparedData.open(write_prepared(tmp_path / "other", 240))
    with pytest.raises(InvalidInput, match="differs from the evaluator's reference"):
        reconstruct(other, real, evaluator, GENERATOR, Perfect())
    small = PreparedData.open(write_prepared(tmp_path / "small", 24))
    with pytest.raises(InvalidInput, match="lacks 36 of 40 clips"):
        reconstruct(small, real, evaluator, GENERATOR, Perfect())


def test_the_command_line_keeps_the_row_beside_the_evaluator_and_writes_a_report(
    prepared: PreparedData, judge: Bundle, tmp_path: Path
) -> None:
    generator, report = random_bundle(tmp_path / "tiny"), tmp_path / "tokenizer.md"
    command = ["evaluator", "reconstruct", str(judge.path), str(generator.path), str(prepared.path)]
    ran = CliRunner().invoke(app, [*command, "-o", str(report), "--json"])
    assert ran.exit_code == 0, ran.output
    kept = find_reconstruction(judge, generator.reference)
    assert kept is not None
    assert kept.error_mm["test"] > 10  # random weights
    assert "The tokenizer of tiny alone" in report.read_text()
    refused = CliRunner().invoke(app, [*command, "-o", str(tmp_path / "x.pdf")])
    assert refused.exit_code != 0


def test_the_reference_of_a_bundle_is_renewed_with_the_same_networks(
    prepared: PreparedData, bundle: Bundle, real: RealClips, tmp_path: Path
) -> None:
    made = renew_reference(bundle, prepared.path, tmp_path / "again")
    assert made.manifest.files["motion.safetensors"] == bundle.manifest.files["motion.safetensors"]
    assert np.array_equal(RealClips.of(made).split("test").motion, real.split("test").motion)
    assert RealClips.of(made).split("test").clips == real.split("test").clips
    own = renew_reference(bundle, write_prepared(tmp_path / "own", 24), tmp_path / "own-judge")
    assert len(RealClips.of(own).split("test").clips) == 4
    assert own.reference != bundle.reference


def test_a_bundle_from_before_joints_were_measured_says_so(real: RealClips, evaluator: TMREvaluator) -> None:
    split = real.split("test")
    clips = tuple(clip.model_copy(update={"quality": None, "obeyed": None}) for clip in split.clips)
    old = RealClips({"test": type(split).of(clips, split.motion)})
    row = truth_row(Ruler(evaluator, old, ("test",), seed=0))
    assert row.values["jerk"].mean is None
    assert "is older than measurements" in row.values["jerk"].note


def test_what_the_joints_of_a_real_clip_say_is_what_the_checker_says(prepared: PreparedData, real: RealClips) -> None:
    kept = real.split("test").clips[0]
    clip = next(clip for clip in prepared.clips if clip.id == kept.id)
    found = check(prepared.layout.decode(prepared.features(clip)), 20.0, None)
    assert kept.quality is not None
    assert kept.quality.jerk == pytest.approx(found.quality.jerk, rel=1e-3)
    assert kept.obeyed is None  # "walks here" has no check
