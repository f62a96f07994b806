"""An evaluation from its npz files to its report, by a small trained evaluator."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from uuid import uuid4

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.data.prepared import PreparedData
from marey.evaluations import EarlierRun, EvaluationJob, EvaluationRequest, MadeItem
from marey.evaluator import scoring
from marey.evaluator.measuring import (
    TOGETHER,
    Broken,
    EvaluatedMotions,
    check_measured,
    embed_prompts,
    encoded,
    measure,
)
from marey.evaluator.reference import RealClips, ReferenceSplit
from marey.evaluator.report import Report, from_json, to_html, to_json, to_markdown
from marey.evaluator.reporting import report_of, summary_of
from marey.evaluator.scoring import REPEATS, EmbeddedSet, label_ceilings, metrics_of, retrieval
from marey.evaluator.tmr import TMREvaluator
from marey.jobs import AssetDigest, FailureReason, ItemState, JobState
from marey.measures.comparing import OBEYED, RETRIEVED
from marey.motion.clip import parse_npz
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.quality.clips import quality_of
from marey.quality.limits import expected_of
from marey.runtime.scoring import ScoreInput

NOON = datetime(2026, 11, 2, 12, tzinfo=UTC)


@pytest.fixture(autouse=True, scope="module")
def _few_subsets() -> Iterator[None]:
    """Let KID draw few subsets: of as many motions as a subset holds, all are the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scoring, "KID_SUBSETS", 2)
        yield


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


@pytest.fixture(scope="module")
def files(prepared: PreparedData) -> list[bytes]:
    """The real clips of the test split, as if a model had made them."""
    clips = [clip for clip in prepared.clips if clip.split == "test"]
    manifest = {"software": {"marey": "0.1.0"}}
    return [finish_motion(prepared.features(c), HUMANML3D_263, manifest=manifest).to_npz() for c in clips]


def source_of(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips, *, repeats: int = 1, **changes: object
) -> ScoreInput:
    """An evaluation whose motions are these files, each `repeats` times."""
    store = {sha256(data): data for data in files}
    items = [
        MadeItem(
            index=index, variant=variant, prompt=real.split("test").clips[index].captions[0], expected="walk",
            seconds=None, seed=index * repeats + variant, state=ItemState.SUCCEEDED, problem=None, frames=60, fps=20.0,
            elapsed=0.1, licence="MIT", npz=AssetDigest(sha256(data), len(data), "application/x-npz"),
        )
        for index, data in enumerate(files)
        for variant in range(repeats)
    ]  # fmt: skip
    request = EvaluationRequest("hgm3-starter@96a91328572d", evaluator.name, "hgm3", repeats=repeats)
    job = EvaluationJob(uuid4(), JobState.SUCCEEDED, len(items), len(items), len(items), NOON, NOON + timedelta(0, 80))
    source = ScoreInput(uuid4(), "monday", request, "f" * 64, job, tuple(items), (), None, store.__getitem__)
    return replace(source, **changes)


def measured_of(source: ScoreInput, evaluator: TMREvaluator) -> EvaluatedMotions:
    return measure(source.items, source.npz, evaluator)


@pytest.fixture(scope="module")
def source(files: list[bytes], evaluator: TMREvaluator, real: RealClips) -> ScoreInput:
    return source_of(files, evaluator, real)


@pytest.fixture(scope="module")
def measured(source: ScoreInput, evaluator: TMREvaluator) -> EvaluatedMotions:
    return measured_of(source, evaluator)


@pytest.fixture(scope="module")
def report(source: ScoreInput, measured: EvaluatedMotions, evaluator: TMREvaluator, real: RealClips) -> Report:
    return report_of(source, measured, evaluator, real)


def test_features_encoded_again_are_those_that_the_joints_were_decoded_from(prepared: PreparedData) -> None:
    features = np.array(prepared.features(prepared.clips[0]))
    clip = finish_motion(features, HUMANML3D_263, clean=False)
    again = encoded(HUMANML3D_263, clip)
    assert again.shape == features.shape
    positions = HUMANML3D_263.slices["positions"]
    assert np.abs(again[:, positions] - features[:, positions]).max() < 0.02


def test_motions_that_are_the_real_ones_have_no_distance_to_them(report: Report) -> None:
    raw = report.row("raw")
    assert raw.values["fid"].mean == pytest.approx(0, abs=1e-3)
    assert raw.values["kid"].mean == pytest.approx(0, abs=1e-3)
    assert raw.values[RETRIEVED].n == report.row("exported").values[RETRIEVED].n == 32


def test_motions_with_a_flag_of_their_quality_record_are_counted(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips, report: Report
) -> None:
    assert report.row("exported").values["flagged"].mean is None
    assert report.row("exported").values["flagged"].note == "no motion has a quality record"
    clips = [parse_npz(data, where="clip") for data in files[:34]]
    records = [quality_of(clip, expected_of(["walk"])) for clip in clips]
    flagged = sum(bool(record and record.flags) for record in records)
    assert 0 < flagged < 34
    made = [
        replace(clip, manifest={**clip.manifest, "quality": record and record.model_dump(mode="json")}).to_npz()
        for clip, record in zip(clips, records, strict=True)
    ]
    source = source_of(made, evaluator, real)
    found = report_of(source, measured_of(source, evaluator), evaluator, real)
    assert found.row("exported").values["flagged"].mean == pytest.approx(100 * flagged / 34)
    assert "flagged" not in found.row("raw").values


def test_what_cannot_be_measured_is_marked_with_its_reason(report: Report) -> None:
    assert report.row("raw").values["r_precision_1_of_100"].mean is None  # 40 clips
    assert "100" in report.row("raw").values["r_precision_1_of_100"].note
    assert report.row("raw").values["diversity"].mean is None  # of 100 pairs
    assert report.row("exported").values["multimodality"].mean is None
    assert report.row("reconstruction").values["fid"].mean is None
    assert report.row("raw").values["fid"].too_few is (report.row("raw").values["fid"].n < 5 * 16)
    assert report.regressed is None  # nothing to compare with


def test_the_report_says_how_motions_came_and_what_made_them(report: Report, evaluator: TMREvaluator) -> None:
    assert (report.prompts, report.motions, report.failed) == (40, 40, 0)
    assert report.generator.name == "hgm3-starter"
    assert f"{report.evaluator.name}@{report.evaluator.sha256}" == evaluator.name if report.evaluator else False
    assert report.speed is not None
    assert report.speed.motions_per_second == pytest.approx(0.5)
    assert report.software == {"marey": "0.1.0"}
    assert 0 < len(report.worst) <= 6
    assert not {e.prompt + str(e.seed) for e in report.best} & {e.prompt + str(e.seed) for e in report.worst}
    assert summary_of(report)[OBEYED] == report.row("exported").values[OBEYED].mean


def test_a_report_is_heard_of_in_each_repeat_of_each_number_that_takes_long(
    source: ScoreInput, measured: EvaluatedMotions, evaluator: TMREvaluator, real: RealClips
) -> None:
    heard: list[None] = []
    report_of(source, measured, evaluator, real, progress=lambda: heard.append(None))
    drawn, rows = ("clip_score", "mm_dist", "diversity"), ("ground truth", "raw", "exported")
    assert len(heard) >= REPEATS * len(drawn) * len(rows)


def test_sentences_are_embedded_a_few_at_a_time_and_each_once(evaluator: TMREvaluator) -> None:
    prompts = [f"a person walks {count} steps" for count in range(TOGETHER + 1)]
    heard: list[None] = []
    found = embed_prompts([*prompts, prompts[0]], evaluator, lambda: heard.append(None))
    assert len(heard) == 2
    np.testing.assert_array_equal(found, evaluator.embed_text([*prompts, prompts[0]]))


def test_fewer_motions_than_a_pool_make_a_report_without_retrieval(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips
) -> None:
    source = source_of(files[:20], evaluator, real)
    found = report_of(source, measured_of(source, evaluator), evaluator, real)
    assert found.row("exported").values[RETRIEVED].mean is None
    assert {score.retrieved for score in found.scores} == {None}
    assert found.row("exported").values[OBEYED].n == 20


def test_sequences_stand_in_one_line_of_the_heat_map_and_single_acts_in_their_own(
    source: ScoreInput, evaluator: TMREvaluator, real: RealClips
) -> None:
    expected = ("walk", "walk then bow", "bow then walk", "walk then bow then run")
    items = tuple(replace(item, expected=expected[item.index % 4]) for item in source.items)
    mixed = replace(source, items=items)
    heat = report_of(mixed, measured_of(mixed, evaluator), evaluator, real).heat
    trials = {act: sum(cell.trials for cell in heat if cell.act == act) for act in {cell.act for cell in heat}}
    assert trials == {"walk": 10, "2 actions in order": 20, "3 actions in order": 10}


def test_all_three_files_are_written_and_the_numbers_can_be_read_back(report: Report) -> None:
    assert b"<canvas" in to_html(report)
    assert b"Prompt adherence" in to_markdown(report)
    assert from_json(to_json(report)).scores == report.scores
    assert len(report.scores) == 40


def test_real_motion_stands_beside_with_what_its_joints_say(report: Report, real: RealClips) -> None:
    truth = report.row("ground_truth").values
    qualities = [clip.quality for clip in real.split("test").clips]
    assert truth["jerk"].mean == pytest.approx(np.mean([q.jerk for q in qualities if q is not None]))
    assert truth["jerk"].mean == pytest.approx(report.row("raw").values["jerk"].mean, rel=1e-3)  # the same motions
    assert truth["skate"].n == 40
    assert "reconstruct" in report.row("reconstruction").values["fid"].note


def test_prompts_of_two_splits_have_columns_for_the_compositional_one(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips
) -> None:
    clips, motion = real.split("test").clips, real.split("test").motion
    parts = {"test": slice(0, 26), "compositional": slice(26, 40)}
    two = RealClips({name: ReferenceSplit.of(clips[at], motion[at]) for name, at in parts.items()})
    base = source_of(files, evaluator, real)
    source = replace(base, request=replace(base.request, source="test+compositional"))
    items = tuple(replace(item, expected="kick" if item.index < 26 else None) for item in source.items)
    source = replace(source, items=items)
    found = report_of(source, measured_of(source, evaluator), evaluator, two)
    values = found.row("raw").values
    assert values["clip_score"].n == 40
    assert values["clip_score_compositional"].n == 14
    assert values["r_precision_3_of_32_compositional"].n < 14  # those of them that came into pools of all 40
    assert values["obeyed"].n == 26
    assert "no prompt has an expectation" in values["obeyed_compositional"].note
    # the same clips, but solved onto the standard body and with locked feet
    assert found.row("ground_truth").values["clip_score_compositional"].mean == pytest.approx(
        values["clip_score_compositional"].mean, abs=0.03
    )
    assert found.metric("kid_compositional").measured_on == "the compositional split"
    assert b"on the compositional split" in to_markdown(found)
    plain = report_of(base, measured_of(base, evaluator), evaluator, real)
    assert "kid_compositional" not in plain.row("raw").values


def test_the_same_evaluation_gives_the_same_numbers(
    source: ScoreInput, measured: EvaluatedMotions, evaluator: TMREvaluator, real: RealClips, report: Report
) -> None:
    again = report_of(source, measured_of(source, evaluator), evaluator, real)
    assert again.rows == report.rows
    assert again.scores == report.scores


def test_repeats_give_an_interval_to_what_is_measured_on_joints(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips
) -> None:
    source = source_of(files[:34], evaluator, real, repeats=2)
    found = report_of(source, measured_of(source, evaluator), evaluator, real)
    assert found.repeats.regenerated == 2
    assert found.row("exported").values["jerk"].half_width == pytest.approx(0)  # both repeats are the same motions
    assert found.row("exported").values["jerk"].n == 34


def test_a_run_whose_motions_stop_doing_what_they_should_has_regressed(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips, report: Report
) -> None:
    scores = tuple(replace(score, obeyed=1.0) for score in report.scores)
    data = to_json(replace(report, scores=scores))
    digest = AssetDigest(sha256(data), len(data), "application/json")
    base = source_of(files, evaluator, real)
    before = EarlierRun(uuid4(), "last week", base.request, summary_of(report), NOON, digest)
    source = replace(base, history=(before,), read=lambda sha: data if sha == digest.sha256 else base.read(sha))
    source = replace(source, items=tuple(replace(item, expected="kick") for item in source.items))
    found = report_of(source, measured_of(source, evaluator), evaluator, real)
    assert found.regressed is True
    assert found.alarms[0].startswith("Prompt adherence fell from 100.0")
    assert [point.evaluation for point in found.trend] == [str(before.id), str(source.evaluation)]


def test_a_motion_that_is_lost_or_broken_is_named_and_counts_in_no_number(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips
) -> None:
    base = source_of(files, evaluator, real)
    bad = AssetDigest("0" * 64, 3, "application/x-npz")
    lost = AssetDigest("1" * 64, 3, "application/x-npz")

    def read(sha256: str) -> bytes:
        if sha256 == lost.sha256:
            raise NotFound("the store has lost it")
        return b"PK?" if sha256 == bad.sha256 else base.read(sha256)

    items = list(base.items)
    items[3], items[7] = replace(items[3], npz=bad), replace(items[7], npz=lost)
    problem = FailureReason("invalid-input", "too long", None, None)
    items[9] = replace(items[9], npz=None, state=ItemState.FAILED, problem=problem)
    source = replace(base, items=tuple(items), read=read)
    found = report_of(source, measured_of(source, evaluator), evaluator, real)
    assert (found.motions, found.failed) == (37, 3)
    assert any("prompt 7" in note and "lost" in note for note in found.notes)
    assert any("prompt 9" in note and "too long" in note for note in found.notes)
    assert {score.index for score in found.scores} == set(range(40)) - {3, 7, 9}


def test_motions_that_hold_nan_are_broken_and_more_than_one_percent_of_them_fail_the_report(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips
) -> None:
    good = parse_npz(files[0])
    features = good.features.copy()
    features[7, 3] = np.nan
    source = source_of([*files[1:], replace(good, features=features).to_npz()], evaluator, real)
    found = measured_of(source, evaluator)
    assert [(each.item.index, each.reason) for each in found.broken] == [
        (39, "`features` holds NaN or infinite numbers")
    ]
    assert np.isfinite(found.raw).all()
    with pytest.raises(InvalidFile, match=r"prompt 39, repeat 0: 1 of 40 motions cannot be measured, 2.5%"):
        check_measured(found, asked=40)


def test_a_hundredth_of_the_motions_may_be_missing(measured: EvaluatedMotions) -> None:
    item = measured.motions[0].item
    motions = (measured.motions * 3)[:99]
    check_measured(replace(measured, motions=motions, broken=(Broken(item, "lost"),)), asked=100)
    check_measured(replace(measured, motions=motions[:90], broken=()), asked=100)  # not made: the scheduler has judged
    with pytest.raises(InvalidFile, match="2 of 100 motions"):
        check_measured(replace(measured, motions=motions[:98], broken=(Broken(item, "lost"),)), asked=100)


def test_the_command_to_repeat_it_is_one_that_a_shell_reads_as_it_was(
    source: ScoreInput, measured: EvaluatedMotions, evaluator: TMREvaluator, real: RealClips
) -> None:
    settings = {"guidance": 4.123456789, "steps": 10.0}
    request = replace(source.request, source="our prompts (new).csv", settings=settings)
    told = shlex.split(report_of(replace(source, request=request), measured, evaluator, real).command)
    assert told[told.index("--split") + 1] == "our prompts (new).csv"
    assert told[-3:] == ["guidance=4.123456789", "--set", "steps=10"]


def test_the_ceiling_of_a_model_that_knows_labels_alone_stands_beside_retrieval(
    report: Report, real: RealClips
) -> None:
    truth = report.row("ground_truth").values
    labels = real.split("test").labels
    ceilings = label_ceilings(labels, 32, seed=0)
    assert f"it would have {ceilings[1]:.1f} % at 1, {ceilings[2]:.1f} % at 2" in truth["r_precision_1_of_32"].note
    assert 100 * len(set(labels.tolist())) / len(labels) - 20 < ceilings[1] < 100
    assert truth["pair_precision_1_of_32"].note == truth["r_precision_1_of_32"].note
    assert "40" in truth["r_precision_1_of_100"].note  # clips, too few: that is what its note says


def test_only_the_pair_is_a_hit_of_the_published_retrieval_and_a_motion_of_its_label_is_one_beside_it(
    evaluator: TMREvaluator,
) -> None:
    vectors = np.random.default_rng(0).normal(size=(4, 8)).astype(np.float32)
    labels = np.arange(40) % 4
    sets = EmbeddedSet(vectors[labels], vectors[labels], labels.astype(np.int64), np.zeros(40, np.int64))
    values = retrieval(sets, evaluator, 32, 0)
    assert values["r_precision_1_of_32"].mean == 100
    ceiling = label_ceilings(labels.astype(np.int64), 32, seed=0)[1]
    assert values["pair_precision_1_of_32"].mean == pytest.approx(ceiling, abs=0.5), "a guess among eight or so"
    assert 10 < ceiling < 15
    assert {metric.label: metric.key for metric in metrics_of(evaluator, ["test"])}["R-precision 1 of 32"] == (
        "pair_precision_1_of_32"
    )


def test_motions_of_another_feature_layout_are_refused(
    files: list[bytes], evaluator: TMREvaluator, real: RealClips, prepared: PreparedData
) -> None:
    clip = finish_motion(np.array(prepared.features(prepared.clips[0])), HUMANML3D_263)
    narrow = replace(clip, features=clip.features[:, :251]).to_npz()
    source = source_of([narrow, *files[1:]], evaluator, real)
    with pytest.raises(InvalidInput, match="251 features"):
        measured_of(source, evaluator)
