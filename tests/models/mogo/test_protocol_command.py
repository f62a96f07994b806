"""The command of the published protocol with generators: other sets, and captions that a language model rewrites."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.main import app
from marey.cli.roles.protocol import measure_rows
from marey.core.settings import settings
from marey.data.prepared import PreparedData
from marey.data.t2m_folder import CMP_SET, HUMANML3D_SET, KIT_SET, T2MSet
from marey.evaluator.protocol.report import published_rows
from marey.evaluator.recorded_answers import MODEL, RecordedAnswers
from marey.models.hgm3.bundle import random_bundle as random_hgm3
from marey.models.hgm3.generate import Generator as HGM3
from marey.models.hgm3.generate import SamplingSettings
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY
from marey.motion.features import KIT_251
from tests.support.protocol import data_to_measure, measure_few, small_evaluator

ANSWERS = {"someone waves.": "A person waves.", "a person crouches": "A human crouches."}
"""To two of the four captions."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    return data_to_measure(tmp_path_factory.mktemp("humanml3d"), HUMANML3D_SET)


@pytest.fixture(scope="module")
def t2m(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return small_evaluator(tmp_path_factory.mktemp("t2m"))


@pytest.fixture(scope="module")
def mogo(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return random_bundle(tmp_path_factory.mktemp("mogo") / "mogo-tiny", replace(TINY, max_frames=196))


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    measure_few(monkeypatch)


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, str]]:
    """The answers of the language model that the settings name."""
    given = dict(ANSWERS)
    with RecordedAnswers(given) as served:
        for name, value in {"rewriter": "tca", "rewriter_url": served.url, "rewriter_model": MODEL}.items():
            monkeypatch.setattr(settings(), name, value)
        yield given


def measure(bundle: Bundle, judge: Bundle, data: PreparedData, output: Path, *, code: int = 0) -> str:
    words = ["eval", "run", "--protocol", "humanml3d", "--bundle", bundle.path, "--evaluator", judge.path, "--data",
             data.path, "--repeats", 2, "--device", "cpu", "-o", output]  # fmt: skip
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done.stderr if code else (output / "report.md").read_text()


def document_in(output: Path) -> Any:
    return json.loads((output / "report.json").read_text())


def test_captions_are_rewritten_where_the_settings_say_so(
    data: PreparedData,
    t2m: Bundle,
    mogo: Bundle,
    answers: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = measure(mogo, t2m, data, tmp_path / "tca")
    assert f"| {mogo.reference} with tca ({MODEL}) | measured here |" in text
    assert f"| {mogo.reference}, tokenizer alone | measured here |" in text
    assert "| MOGO with TCA | MOGO Tab. 2 |" in text
    found = document_in(tmp_path / "tca")
    assert found["rewriter"] == {"name": "tca", "model": MODEL}
    assert found["read"] == [{"captions": 4, "rewritten": 2}] * 2
    assert f"4 of 8 captions, counted in each repeat, were rewritten by tca ({MODEL}); the others were read" in text

    monkeypatch.setattr(settings(), "rewriter", None)
    refused = measure(mogo, t2m, data, tmp_path / "tca", code=2)
    assert "of another generator, evaluator, data or options" in refused
    plain = measure(mogo, t2m, data, tmp_path / "plain")
    assert f"| {mogo.reference} | measured here |" in plain
    without = document_in(tmp_path / "plain")
    assert "rewriter" not in without
    for here, there in zip(without["repeats"], found["repeats"], strict=True):
        assert here[t2m.reference]["real"] == there[t2m.reference]["real"]
        assert here[t2m.reference]["generated"] != there[t2m.reference]["generated"]


def test_a_rewriter_that_rewrites_no_caption_has_no_row(
    data: PreparedData, t2m: Bundle, mogo: Bundle, answers: dict[str, str], tmp_path: Path
) -> None:
    answers.clear()
    assert "the rewriter 'tca' rewrote no caption: " in measure(mogo, t2m, data, tmp_path / "out", code=2)


@pytest.mark.parametrize(
    "kind", [KIT_SET, pytest.param(CMP_SET, marks=pytest.mark.slow)], ids=lambda kind: kind.terms.name
)
def test_other_sets_are_measured_beside_the_papers_rows_of_them(
    kind: T2MSet, tmp_path: Path, t2m: Bundle, mogo: Bundle
) -> None:
    data = data_to_measure(tmp_path, kind)
    if kind is KIT_SET:
        t2m = small_evaluator(tmp_path / "t2m", KIT_251)
        config = replace(TINY, max_frames=196, layout="kit-251", features=251, joints=21, fps=12.5)
        mogo = random_bundle(tmp_path / "mogo-kit", config)
    text = measure(mogo, t2m, data, tmp_path / "out")
    for row in ("real motions", mogo.reference, f"{mogo.reference}, tokenizer alone"):
        assert f"| {row} | measured here | " in text
    name = kind.terms.name
    papers = [row for row in published_rows() if row.data == name]
    assert all(f"| {row.name} | {row.source} | " in text for row in papers)
    assert len(papers) > 1
    assert "| 0.511 |" not in text, "a row of HumanML3D"
    repeat = document_in(tmp_path / "out")["repeats"][1][t2m.reference]
    assert repeat["generated"]["fid"] > 0 < repeat["generated"]["mmodality"]


def test_rows_of_ablations_are_measured_as_they_are_decoded(
    data: PreparedData, t2m: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    generator = HGM3.load(random_hgm3(tmp_path / "hgm3-tiny"), device="cpu", threads=1)
    measure = measure_rows(data.path, str(t2m.path), 2, device="cpu")
    flat = measure(generator, SamplingSettings(steps=1, motion_steps=0, action_steps=0), tmp_path / "flat")
    whole = measure(generator, SamplingSettings(steps=1, motion_steps=1, action_steps=1), tmp_path / "whole")
    assert set(flat) == {"FID", "Top-1", "MM-Dist", "FID, tokenizer alone"}
    assert flat["FID"] != whole["FID"]
    assert flat["FID, tokenizer alone"] == whole["FID, tokenizer alone"]
    found = document_in(tmp_path / "flat")
    repeats = [each[t2m.reference]["generated"] for each in found["repeats"]]
    assert flat["Top-1"] == pytest.approx(sum(each["r1"] for each in repeats) / 2)
    assert "mmodality" not in repeats[0], "tables of ablations have none"
    assert "| HGM³ | HGM³ Tab. 1 |" in (tmp_path / "flat" / "report.md").read_text()
