"""The published protocol: what is drawn, what is measured, and how a run goes on."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.main import app
from marey.cli.roles.tokenizers import tokenizer_of
from marey.core.errors import InvalidFile, InvalidInput
from marey.core.settings import settings
from marey.data.prepared import PreparedData
from marey.data.t2m_folder import HUMANML3D_SET
from marey.evaluator.loading import load_evaluator
from marey.evaluator.metrics.distribution import fid
from marey.evaluator.protocol import Judge, ProtocolOptions, Subject, run_protocol
from marey.evaluator.protocol.metrics import METRICS
from marey.evaluator.protocol.report import document_of, markdown_of, published_rows
from marey.evaluator.protocol.samples import draw_samples
from marey.evaluator.reconstruction import rebuilt
from marey.generation.port import Generated, Generator
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.generate import Generator as HGM3
from tests.support.protocol import data_to_measure, small_evaluator
from tests.support.texts import shared_pipeline
from tests.support.tiny_encoders import write_tiny_distilbert
from tests.support.tmr_download import write_tmr_download

SIZES = ProtocolOptions(repeats=2, pool=4, many=5, prompts=2, pairs=3)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    return data_to_measure(tmp_path_factory.mktemp("protocol"), HUMANML3D_SET)


@pytest.fixture(scope="module")
def t2m(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return small_evaluator(tmp_path_factory.mktemp("t2m"))


@pytest.fixture(scope="module")
def judge(t2m: Bundle, data: PreparedData) -> Judge:
    return Judge(load_evaluator(t2m, device="cpu", captions=data), "t2m")


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    bundle = random_bundle(tmp_path_factory.mktemp("generator") / "random-tiny")
    generator = HGM3.load(bundle, device="cpu", dtype=torch.float32)
    settings = {"steps": 2, "motion_steps": 0, "action_steps": 0}
    return Subject(generator, shared_pipeline(), generator.settings(settings), tokenizer_of(bundle))


def test_each_clip_is_drawn_once_with_one_of_its_captions_at_a_multiple_of_four_frames(data: PreparedData) -> None:
    samples = draw_samples(data, "test", 4, np.random.default_rng(0))
    assert len(samples) == 36, "the last, incomplete pool is dropped"
    assert {len(sample.motion) for sample in samples} == {60, 56, 64, 92, 96}
    assert {sample.caption for sample in samples} == {
        "someone waves.", "a figure bends", "a man turns and walks.", "a person crouches",
    }  # fmt: skip
    again = draw_samples(data, "test", 4, np.random.default_rng(1))
    assert [sample.caption for sample in again] != [sample.caption for sample in samples]
    with pytest.raises(InvalidInput, match="39 clips with captions; a pool has 40"):
        draw_samples(data, "test", 40, np.random.default_rng(0))


class Echo:
    """A generator that gives back the test clips: it is asked for their lengths."""

    def __init__(self, wrapped: Generator) -> None:
        self.wrapped = wrapped
        self.asked: list[tuple[int, int]] = []

    def __getattr__(self, name: str) -> object:
        return getattr(self.wrapped, name)

    def generate(self, requests: Sequence, settings: object) -> list[Generated | None]:
        self.asked += [(request.frames, request.seed) for request in requests]
        return list(self.wrapped.generate(requests, settings))


def test_every_repeat_generates_the_captions_anew_at_the_lengths_of_their_clips(
    data: PreparedData, judge: Judge, subject: Subject, tmp_path: Path
) -> None:
    echo = Echo(subject.generator)
    seen: list[tuple[int, int, int]] = []
    found = run_protocol(
        data, replace(subject, generator=echo), [judge], tmp_path, SIZES, progress=lambda *done: seen.append(done)
    )
    assert len(echo.asked) == 2 * (36 + 2 * 5)
    assert len({seed for _, seed in echo.asked}) == len(echo.asked), "no motion twice"
    assert {frames for frames, _ in echo.asked} <= {56, 60, 64, 92, 96}
    assert seen[-1] == (1, 46, 46)
    rows = found["repeats"][0][judge.evaluator.name]
    measured = set(METRICS) - {"clip_score"}  # which evaluators have that compare by cosine
    assert set(rows["generated"]) == measured
    assert set(rows["real"]) == measured - {"fid", "mmodality"}
    assert set(rows["reconstructed"]) == measured - {"mmodality"}
    assert rows["generated"]["fid"] > 0 < rows["generated"]["mmodality"]
    assert found["repeats"][1] != found["repeats"][0]


def test_numbers_are_those_of_the_metrics_on_the_evaluators_embeddings(
    data: PreparedData, judge: Judge, tmp_path: Path
) -> None:
    found = run_protocol(data, None, [judge], tmp_path, SIZES)
    drawing = np.random.default_rng(np.random.SeedSequence([0, 0]).spawn(2)[0])
    samples = draw_samples(data, "test", 4, drawing)
    text = judge.evaluator.embed_text([sample.caption for sample in samples])
    motion = judge.evaluator.embed_motion([sample.motion for sample in samples])
    real = found["repeats"][0][judge.evaluator.name]["real"]
    assert real["mm_dist"] == pytest.approx(float(np.linalg.norm(text - motion, axis=1).mean()), rel=1e-5)
    assert 0 <= real["r1"] <= real["r2"] <= real["r3"] <= 1
    assert "generated" not in found["repeats"][0][judge.evaluator.name]


def test_the_tokenizer_alone_has_a_row(data: PreparedData, judge: Judge, subject: Subject, tmp_path: Path) -> None:
    found = run_protocol(data, subject, [judge], tmp_path / "whole", SIZES)
    rows = found["repeats"][1][judge.evaluator.name]
    drawing = np.random.default_rng(np.random.SeedSequence([0, 1]).spawn(2)[0])
    motions = [sample.motion for sample in draw_samples(data, "test", 4, drawing)]
    assert subject.tokenizer is not None
    through = [rebuilt(subject.tokenizer, [motion])[0] for motion in motions]
    assert [len(motion) for motion in through] == [len(motion) for motion in motions]
    real, made = judge.evaluator.embed_motion(motions), judge.evaluator.embed_motion(through)
    assert rows["reconstructed"]["fid"] == pytest.approx(fid(real, made).value, rel=1e-3)
    name = f"{subject.generator.bundle.reference}, tokenizer alone"
    (row,) = [row for row in document_of(found)["rows"] if row["name"] == name]
    values = [each[judge.evaluator.name]["reconstructed"]["fid"] for each in found["repeats"]]
    assert row["values"]["fid"] == [pytest.approx(np.mean(values)), pytest.approx(1.96 * np.std(values) / 2**0.5)]
    assert f"| {name} | measured here |" in markdown_of(found)
    assert "| MOGO, tokenizer alone | MOGO Tab. 1 | - | - | - | 0.013 ± 0.001 |" in markdown_of(found)

    without = run_protocol(data, replace(subject, tokenizer=None), [judge], tmp_path / "without", SIZES)
    assert "reconstructed" not in without["repeats"][0][judge.evaluator.name]
    for kind in ("real", "generated"):
        assert without["repeats"][0][judge.evaluator.name][kind] == found["repeats"][0][judge.evaluator.name][kind]
    with pytest.raises(InvalidInput, match="of another generator, evaluator, data or options"):
        run_protocol(data, subject, [judge], tmp_path / "without", SIZES)


def test_a_run_goes_on_where_it_stopped_and_refuses_a_folder_of_another(
    data: PreparedData, judge: Judge, tmp_path: Path
) -> None:
    first = run_protocol(data, None, [judge], tmp_path, SIZES)
    more = run_protocol(data, None, [judge], tmp_path, replace(SIZES, repeats=3))
    assert more["repeats"][:2] == first["repeats"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"repeat-0{number}.json" for number in range(3)]
    with pytest.raises(InvalidInput, match="of another generator, evaluator, data or options"):
        run_protocol(data, None, [judge], tmp_path, replace(SIZES, seed=1))
    (tmp_path / "repeat-01.json").write_text("[]")
    with pytest.raises(InvalidFile, match="not a repeat"):
        run_protocol(data, None, [judge], tmp_path, SIZES)
    with pytest.raises(InvalidInput, match="no interval"):
        run_protocol(data, None, [judge], tmp_path, replace(SIZES, repeats=1))


def test_the_report_stands_beside_the_papers_rows_of_its_evaluator_and_data(
    data: PreparedData, judge: Judge, tmp_path: Path
) -> None:
    found = run_protocol(data, None, [judge], tmp_path, SIZES)
    text = markdown_of(found)
    assert f"## By `{judge.evaluator.name}`" in text
    assert "| HGM³ | HGM³ Tab. 1 | 0.535 ± 0.002 | 0.726 ± 0.002 | 0.822 ± 0.002 | 0.036 ± 0.002 |" in text
    assert "0.444" not in text, "a row of KIT-ML"
    assert "| real motions | Guo et al. 2022 | 0.511 |" in text
    rows = document_of(found)["rows"]
    mean, half = rows[0]["values"]["r1"]
    values = [each[judge.evaluator.name]["real"]["r1"] for each in found["repeats"]]
    assert (mean, half) == (pytest.approx(np.mean(values)), pytest.approx(1.96 * np.std(values) / 2**0.5))
    other = {**found, "kinds": {judge.evaluator.name: "tmr"}}
    assert "HGM³ Tab. 1" not in markdown_of(other), "papers did not measure by this evaluator"
    assert "none compares" in markdown_of(other)


def test_published_rows_are_complete() -> None:
    rows = {(row.name, row.data): row.values for row in published_rows()}
    assert rows["MOGO", "humanml3d"]["fid"] == (0.038, 0.002)
    assert rows["HGM³", "kit"]["mm_dist"] == (2.710, 0.019)
    assert rows["real motions", "humanml3d"]["r1"] == (0.511, None)
    assert {data for _, data in rows} == {"humanml3d", "kit", "cmp"}


def test_the_command_measures_real_motions_and_writes_the_report(
    data: PreparedData, t2m: Bundle, tmp_path: Path
) -> None:
    words = ["eval", "run", "--protocol", "humanml3d", "--bundle", "real", "--evaluator", str(t2m.path), "--data",
             str(data.path), "--repeats", "2", "-o", str(tmp_path / "out")]  # fmt: skip
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "| real motions | measured here |" in done.stdout
    document = json.loads((tmp_path / "out" / "report.json").read_text())
    assert document["options"]["pool"] == 32
    assert (tmp_path / "out" / "report.md").read_text().startswith("# Real motions, protocol of Guo et al. 2022")
    for extra, message in ((["--baseline", "x"], "--baseline"), (["--regenerate"], "--regenerate")):
        refused = CliRunner().invoke(app, [*words, *extra])
        assert refused.exit_code == 2
        assert message in refused.stderr
    alone = CliRunner().invoke(app, ["eval", "run", "--bundle", "hgm3", "--data", str(data.path)])
    assert alone.exit_code == 2
    assert "is for --protocol" in alone.stderr


def test_the_command_measures_by_an_imported_evaluator_that_compares_by_cosine(
    data: PreparedData, t2m: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(settings(), "models", tmp_path / "bundles")
    monkeypatch.setattr(settings(), "home", tmp_path / "home")
    (tmp_path / "distilbert").mkdir()
    distilbert = write_tiny_distilbert(tmp_path / "distilbert")
    words = ["models", "import", "tmr", str(write_tmr_download(tmp_path)), "-o", str(tmp_path / "bundles" / "tmr"),
             "--text-encoder", str(distilbert)]  # fmt: skip
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == 2
    assert "--licence" in refused.stderr
    done = CliRunner().invoke(app, [*words, "--licence", "LicenseRef-AMASS-NC"])
    assert done.exit_code == 0, done.output

    words = ["eval", "run", "--protocol", "humanml3d", "--bundle", "real", "--evaluator", str(t2m.path), "--evaluator",
             "tmr", "--data", str(data.path), "--repeats", "2", "-o", str(tmp_path / "out")]  # fmt: skip
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    document = json.loads((tmp_path / "out" / "report.json").read_text())
    evaluator = load_evaluator("tmr", device="cpu")
    assert document["kinds"] == {t2m.reference: "t2m", evaluator.name: "tmr-published"}
    drawing = np.random.default_rng(np.random.SeedSequence([0, 1]).spawn(2)[0])
    samples = draw_samples(data, "test", 32, drawing)
    text = evaluator.embed_text([sample.caption for sample in samples])
    motion = evaluator.embed_motion([sample.motion for sample in samples])
    unit = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (text, motion)]
    found = document["repeats"][1][evaluator.name]["real"]
    assert found["clip_score"] == pytest.approx(float((unit[0] * unit[1]).sum(1).mean()), abs=1e-6)
    assert 0 <= found["r1"] <= found["r2"] <= found["r3"] <= 1
    assert "clip_score" not in document["repeats"][1][t2m.reference]["real"]
    by_t2m, by_tmr = (tmp_path / "out" / "report.md").read_text().split("\n## By ")[1:]
    assert "| MoMask | HGM³ Tab. 1 |" in by_t2m
    assert "HGM³ Tab. 1" not in by_tmr, "papers did not measure by this evaluator"
    assert "| CLIP score ↑ |" in by_tmr


def test_real_motion_has_no_distance_from_itself(data: PreparedData, judge: Judge) -> None:
    samples = draw_samples(data, "test", 4, np.random.default_rng(0))
    motion = judge.evaluator.embed_motion([sample.motion for sample in samples])
    assert fid(motion, motion).value == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.skipif(
    not (os.environ.get("MAREY_T2M_EVALUATOR") and os.environ.get("MAREY_HUMANML3D")),
    reason="needs MAREY_T2M_EVALUATOR, an imported t2m-evaluator, and MAREY_HUMANML3D, prepared HumanML3D",
)
def test_the_row_of_real_motion_is_the_published_one(tmp_path: Path) -> None:
    """Guo et al. 2022, on the public weights and data."""
    data = PreparedData.open(os.environ["MAREY_HUMANML3D"])
    bundle = Bundle.open(Path(os.environ["MAREY_T2M_EVALUATOR"]))
    judge = Judge(load_evaluator(bundle, captions=data), "t2m")
    rows = document_of(run_protocol(data, None, [judge], tmp_path, ProtocolOptions()))["rows"]
    measured = {name: mean for name, (mean, _) in rows[0]["values"].items()}
    assert measured["r1"] == pytest.approx(0.511, abs=0.006)
    assert measured["r2"] == pytest.approx(0.703, abs=0.006)
    assert measured["r3"] == pytest.approx(0.797, abs=0.006)
    assert measured["mm_dist"] == pytest.approx(2.974, abs=0.02)
    assert measured["diversity"] == pytest.approx(9.503, abs=0.2)
