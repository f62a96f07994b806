"""`marey data paraphrase`: captions in other words, by a language model that answers well, wrongly or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from marey.cli.main import app
from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import settings
from marey.data.caption_files import read_caption_files
from marey.data.dataset import DATASET, INDEX, SETS
from marey.data.paraphrase import CLIPS_AT_ONCE, FILE
from marey.data.prepare import CaptureSet
from marey.text import openai_rewriter
from tests.support.language_model import ChatRequest, CompletionReply, LanguageModel

STUDIO = (SETS / "bandai-namco" / DATASET).read_text().replace('"bandai-namco"', '"studio"', 1)
ROWS = "file,start,end,action,captions\na.bvh,0,90,walk,a person walks to the left\na.bvh,90,100,none,nothing\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(openai_rewriter.time, "sleep", lambda seconds: None)
    (tmp_path / DATASET).write_text(STUDIO)
    (tmp_path / INDEX).write_text(ROWS)
    (tmp_path / "captions-x.csv").write_text("id,captions\na@0,Two steps.\n")
    settings.cache_clear()
    yield tmp_path
    settings.cache_clear()


def run(folder: Path, model: LanguageModel, monkeypatch: pytest.MonkeyPatch, *more: str) -> tuple[int, str]:
    monkeypatch.setenv("MAREY_REWRITER_URL", model.url)
    monkeypatch.setenv("MAREY_REWRITER_MODEL", "some-model")
    settings.cache_clear()
    done = CliRunner().invoke(app, ["data", "paraphrase", str(folder), *more])
    return done.exit_code, done.output


def written(folder: Path) -> dict[str, tuple[str, ...]]:
    files = read_caption_files(folder, CaptureSet.own(folder).rows)
    return dict(next(file.captions for file in files if file.name == FILE))


def test_each_caption_is_rephrased_in_several_manners(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(asked: ChatRequest, before: int) -> CompletionReply:
        manner = "plainly" if "structure of the sentences" in asked.question["messages"][0]["content"] else "slowly"
        return CompletionReply(f"{asked.prompt.rstrip('.')} {manner}")

    with LanguageModel(answer) as model:
        code, said = run(folder, model, monkeypatch)
    assert code == 0, said
    assert "4 paraphrases written; clips that have some: 1" in said
    assert written(folder) == {
        "a@0": (
            "a person walks to the left plainly",
            "a person walks to the left slowly",
            "Two steps plainly",
            "Two steps slowly",
        )
    }
    assert len(model.asked) == 4  # the row that is left out is not asked for


def test_answers_that_change_the_movement_are_not_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = {
        "a person walks to the left": ["someone walks to the right", "someone runs to the left"],
        "Two steps.": ["Three steps.", "two steps."],
    }

    def answer(asked: ChatRequest, before: int) -> CompletionReply:
        first = "structure of the sentences" in asked.question["messages"][0]["content"]
        return CompletionReply(answers[asked.prompt][0 if first else 1])

    with LanguageModel(answer) as model:
        code, said = run(folder, model, monkeypatch)
        assert code == Unreachable.exit_code
        assert "gave no usable answer" in said
        assert not (folder / FILE).exists()
        answers["Two steps."][0] = "A pair of two paces."
        code, said = run(folder, model, monkeypatch)
    assert code == 0, said
    for reason in ("changes a side", "changes the actions: walk became run", "says the same words"):
        assert reason in said
    assert written(folder) == {"a@0": ("A pair of two paces.",)}


def test_a_second_call_goes_on_with_what_is_missing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = "".join(f"{n}.bvh,,,walk,walk number {n}\n" for n in range(CLIPS_AT_ONCE + 2))
    (folder / INDEX).write_text(f"file,start,end,action,captions\n{rows}")
    (folder / "captions-x.csv").unlink()

    def fails_at_last(asked: ChatRequest, before: int) -> CompletionReply:
        return CompletionReply(status=400) if before >= CLIPS_AT_ONCE else CompletionReply(f"go on: {asked.prompt}")

    with LanguageModel(fails_at_last) as model:
        code, _ = run(folder, model, monkeypatch, "--times", "1")
        assert code == Unreachable.exit_code
        assert len(written(folder)) == CLIPS_AT_ONCE
        model.answer = lambda asked, before: CompletionReply(f"go on: {asked.prompt}")
        model.asked.clear()
        code, _ = run(folder, model, monkeypatch, "--times", "1")
        assert code == 0
        assert len(model.asked) == 2
    assert len(written(folder)) == CLIPS_AT_ONCE + 2


def test_it_needs_captions_a_model_and_a_number_of_times(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = CliRunner().invoke(app, ["data", "paraphrase", str(folder)])
    assert done.exit_code == InvalidInput.exit_code
    assert "no language model is named" in done.output
    with LanguageModel(lambda asked, before: CompletionReply("")) as model:
        code, said = run(folder, model, monkeypatch, "--times", "5")
        assert code == InvalidInput.exit_code
        assert "captions are rephrased 1 to 4 times" in said
        (folder / INDEX).write_text("file,start,end,action,captions\na.bvh,0,90,walk,\n")
        (folder / "captions-x.csv").unlink()
        code, said = run(folder, model, monkeypatch)
    assert code == InvalidInput.exit_code
    assert "no clip has captions" in said
    assert not model.asked
