"""Timelines, constraints and edited motions of an evaluation, from their npz files to the sections of the report."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from uuid import uuid4

import numpy as np
import pytest

from marey.data.prepared import PreparedData
from marey.evaluations import EarlierRun, MadeItem
from marey.evaluator.measuring import EvaluatedMotions, measure
from marey.evaluator.reference import RealClips
from marey.evaluator.report import Report, from_json, to_html, to_json, to_markdown
from marey.evaluator.reporting import report_of, summary_of
from marey.evaluator.scoring import EMBEDDED
from marey.evaluator.shots import rows_of
from marey.evaluator.tmr import TMREvaluator
from marey.jobs import AssetDigest
from marey.measures.comparing import OBEYED, RETRIEVED
from marey.motion.clip import MotionClip, parse_npz
from marey.motion.edits.cuts import part
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.quality.clips import quality_of
from marey.quality.constraints import ConstraintError
from marey.quality.limits import expected_of
from marey.runtime.scoring import ScoreInput
from tests.unit.evaluator.test_reporting import NOON, sha256, source_of

SINGLE, TIMELINES, KINEMATIC = 34, (34, 35), (36, 37)
"""Prompts alone; timelines; a constrained motion and an edited one."""
ROWS = (("0-3", "a person walks forward", 0.9), ("3-6", "a person bows", 0.2), ("7-20", "asdf qwer", None))


def timeline_of(features: Any) -> MotionClip:
    """20 seconds of a walker, with rows that say what he does and what he does not."""
    times = [(*(float(at) for at in times.split("-")), prompt, match) for times, prompt, match in ROWS]
    rows = [{"start": a, "end": b, "prompt": prompt, "seed": 1, "match": match} for a, b, prompt, match in times]
    manifest = {"timeline": {"rows": rows, "transitions": [], "gaps": []}}
    return finish_motion(np.resize(features, (400, features.shape[1])), HUMANML3D_263, manifest=manifest)


def constrained(clip: MotionClip, *errors: ConstraintError) -> MotionClip:
    """The clip as a fit to constraints leaves it: without features, with errors in its record."""
    record = quality_of(clip, expected_of(["walk"]))
    assert record is not None
    quality = record.with_constraints(errors).model_dump(mode="json")
    return replace(part(clip, 0, clip.frames - 1), manifest={**clip.manifest, "quality": quality})


@pytest.fixture(scope="module")
def shots(prepared: PreparedData, evaluator: TMREvaluator, real: RealClips) -> ScoreInput:
    clips = [clip for clip in prepared.clips if clip.split == "test"]
    features = [prepared.features(clip) for clip in clips]
    made = [finish_motion(each, HUMANML3D_263) for each in features[: KINEMATIC[1] + 1]]
    for index in TIMELINES:
        made[index] = timeline_of(features[index])
    errors = (
        ConstraintError.of(0, "root_path", 0.02, 0.31, 4.0),
        ConstraintError.of(1, "pose_keyframe", 0.01, 0.02, None),
    )
    made[KINEMATIC[0]] = constrained(made[KINEMATIC[0]], *errors)
    made[KINEMATIC[1]] = part(made[KINEMATIC[1]], 0, made[KINEMATIC[1]].frames - 1)
    source = source_of([clip.to_npz() for clip in made], evaluator, real)
    items = [replace(item, expected=None) if item.index in TIMELINES else item for item in source.items]
    items[KINEMATIC[0]] = replace(items[KINEMATIC[0]], constrained=True)
    return replace(source, items=tuple(items), request=replace(source.request, source="shots.jsonl"))


@pytest.fixture(scope="module")
def measured(shots: ScoreInput, evaluator: TMREvaluator) -> EvaluatedMotions:
    return measure(shots.items, shots.npz, evaluator)


@pytest.fixture(scope="module")
def report(shots: ScoreInput, measured: EvaluatedMotions, evaluator: TMREvaluator, real: RealClips) -> Report:
    return report_of(shots, measured, evaluator, real)


def test_rows_are_cut_out_and_judged_by_their_own_prompts(shots: ScoreInput) -> None:
    rows = rows_of(parse_npz(shots.npz(shots.items[TIMELINES[0]])))
    assert [(each.row.times, each.row.prompt, each.match) for each in rows] == list(ROWS)
    assert rows[1].shown is False  # a walker does not bow
    assert rows[2].shown is None  # no action with a rule
    assert [each.fails for each in rows[1:]] == [True, False]


def test_rows_beyond_the_end_of_a_cut_timeline_are_not_judged(shots: ScoreInput) -> None:
    whole = parse_npz(shots.npz(shots.items[TIMELINES[0]]))
    short = replace(part(whole, 0, 50), manifest=whole.manifest)
    assert [each.shown for each in rows_of(short)][1:] == [None, None]


def test_a_row_fails_by_the_referee_or_by_its_match(shots: ScoreInput) -> None:
    row = rows_of(parse_npz(shots.npz(shots.items[TIMELINES[0]])))[0]
    states = {(True, 0.9): False, (True, 0.2): True, (False, 0.9): True, (None, None): False, (False, None): True}
    for (shown, match), fails in states.items():
        assert replace(row, shown=shown, match=match).fails is fails


def test_timelines_have_a_section_with_counts_and_the_rows_that_fail(report: Report) -> None:
    section = report.timelines
    assert section is not None
    assert (section.motions, section.rows, section.judged) == (2, 6, 4)
    assert (section.matched, section.off_prompt) == (4, 2)
    assert section.shown <= 2
    assert {(row.prompt, row.times) for row in section.worst} >= {("a person bows", "3-6")}
    assert {row.index for row in section.worst} == set(TIMELINES)


def test_timelines_are_left_out_of_embeddings_and_stay_in_measures_of_joints(
    report: Report, measured: EvaluatedMotions
) -> None:
    values = report.row("exported").values
    assert values["clip_score"].n == len(measured.motions) - 2
    assert values["fid"].n == min(len(measured.motions) - 2, 40)
    assert values["jerk"].n == len(measured.motions) == 38
    assert values[OBEYED].n == 36
    assert not measured.exported[~measured.single].any()
    assert values[RETRIEVED].n == 32
    scores = {score.index: score for score in report.scores}
    assert [scores[index].retrieved for index in TIMELINES] == [None, None]
    assert report.timelines is not None
    shown = [scores[index].rows_shown for index in TIMELINES]
    assert sum(2 * (share or 0.0) for share in shown) == report.timelines.shown  # two rows of each are judged
    assert scores[SINGLE - 1].rows_shown is None
    assert any(scores[index].retrieved is not None for index in range(SINGLE))
    assert not {each.seed for each in (*report.best, *report.worst)} & set(TIMELINES)


def test_constraints_have_a_table_of_errors_and_what_was_missed(report: Report) -> None:
    section = report.constraints
    assert section is not None
    assert (section.motions, section.missed, section.unknown) == (1, 1, 0)
    kinds = {kind.type: kind for kind in section.kinds}
    assert (kinds["root_path"].missed, kinds["root_path"].max_m, kinds["root_path"].mean_deg) == (1, 0.31, 4.0)
    assert (kinds["pose_keyframe"].missed, kinds["pose_keyframe"].mean_deg) == (0, None)
    (worst,) = section.worst
    assert (worst.index, worst.place, worst.type) == (KINEMATIC[0], 0, "root_path")


def test_constraints_without_a_record_of_errors_are_counted_apart(
    shots: ScoreInput, measured: EvaluatedMotions, evaluator: TMREvaluator, real: RealClips
) -> None:
    lost = replace(measured.motions[0], item=replace(measured.motions[0].item, constrained=True))
    found = report_of(shots, replace(measured, motions=(lost, *measured.motions[1:])), evaluator, real)
    assert found.constraints is not None
    assert (found.constraints.motions, found.constraints.unknown) == (1, 1)


def test_motions_without_features_are_measured_on_their_files(
    report: Report, measured: EvaluatedMotions, shots: ScoreInput
) -> None:
    assert [motion.item.index for motion in measured.motions if motion.kinematic] == list(KINEMATIC)
    for index in KINEMATIC:
        assert not parse_npz(shots.npz(shots.items[index])).features.size
        np.testing.assert_allclose(measured.raw[index], measured.exported[index])
    assert any(note.startswith("2 motions were changed after the network") for note in report.notes)


def test_the_sections_are_in_all_three_files(report: Report) -> None:
    page, text = to_html(report).decode(), to_markdown(report).decode()
    for words in ("Timelines", "Constraints", "2 of 4 (50.0 %)", "31.0 cm", "“a person bows”"):
        assert words in page
        assert words in text
    again = from_json(to_json(report))
    assert (again.timelines, again.constraints) == (report.timelines, report.constraints)


def test_reports_without_shots_have_no_such_sections(report: Report) -> None:
    plain = replace(report, timelines=None, constraints=None)
    assert "Timelines" not in to_markdown(plain).decode()
    assert 'id="constraints"' not in to_html(plain).decode()


def test_timelines_alone_make_a_report_without_embeddings(
    shots: ScoreInput, evaluator: TMREvaluator, real: RealClips
) -> None:
    few: tuple[MadeItem, ...] = tuple(
        replace(shots.items[at], index=number, seed=number) for number, at in enumerate(TIMELINES)
    )
    only = replace(shots, items=few)
    found = report_of(only, measure(only.items, only.npz, evaluator), evaluator, real)
    values = found.row("exported").values
    assert {values[name].mean for name in (*EMBEDDED, RETRIEVED)} == {None}
    assert "every motion is a timeline" in values["fid"].note
    assert values["jerk"].mean is not None
    assert found.best == found.worst == ()


def test_a_later_run_of_timelines_alone_finds_nothing_to_compare_and_does_not_fail(
    shots: ScoreInput, evaluator: TMREvaluator, real: RealClips
) -> None:
    few = tuple(replace(shots.items[at], index=number, seed=number) for number, at in enumerate(TIMELINES))
    only = replace(shots, items=few)
    first = report_of(only, measure(only.items, only.npz, evaluator), evaluator, real)
    data = to_json(first)
    digest = AssetDigest(sha256(data), len(data), "application/json")
    before = EarlierRun(uuid4(), None, only.request, summary_of(first), NOON, digest)
    later = replace(only, history=(before,), read=lambda sha: data if sha == digest.sha256 else only.read(sha))
    again = report_of(later, measure(later.items, later.npz, evaluator), evaluator, real)
    assert (again.regressed, again.changes) == (False, ())


def test_one_motion_of_one_prompt_beside_timelines_makes_a_report(
    shots: ScoreInput, evaluator: TMREvaluator, real: RealClips
) -> None:
    only = replace(shots, items=tuple(replace(shots.items[at], index=n) for n, at in enumerate((0, *TIMELINES))))
    found = report_of(only, measure(only.items, only.npz, evaluator), evaluator, real)
    assert found.row("exported").values["clip_score"].n == 1
    assert found.row("exported").values["fid"].mean is None
