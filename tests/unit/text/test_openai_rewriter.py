"""The rewriter `openai` against an endpoint that answers well, late, wrongly or not at all."""

from __future__ import annotations

import logging
import socket
from collections.abc import Iterator

import pytest
from pydantic import SecretStr, ValidationError

from marey.bundles import TextSpec
from marey.core.errors import InvalidBundle, InvalidInput
from marey.core.settings import Settings
from marey.text import loading, openai_rewriter
from marey.text.features import TextFeatures
from marey.text.keys import as_served, feature_key
from marey.text.loading import load_rewriter
from marey.text.openai_rewriter import AT_ONCE, MAX_ANSWER_BYTES, REST_AFTER, TRIES, Endpoint, OpenAIRewriter
from marey.text.pipeline import TextPipeline
from marey.text.rewriters import NotRewritten, Rewrite
from marey.text.wordings import alignment, question_of
from marey.vocabulary.entries import load_vocabulary
from tests.support.language_model import ChatRequest, CompletionReply, LanguageModel
from tests.support.texts import shared_pipeline

PROMPT = "plz make him stroll to the left"
CAPTION = "A person strolls to the left."
KEY = "sk-do-not-tell"


@pytest.fixture
def model() -> Iterator[LanguageModel]:
    with LanguageModel(lambda asked, before: CompletionReply(CAPTION)) as served:
        yield served


@pytest.fixture(autouse=True)
def no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openai_rewriter.time, "sleep", lambda seconds: None)


def rewriter_of(model: LanguageModel, seconds: float = 30.0) -> OpenAIRewriter:
    return OpenAIRewriter(Endpoint(model.url, "some-model", SecretStr(KEY), seconds), question_of("caption"))


def reason_of(rewriter: OpenAIRewriter, prompt: str = PROMPT) -> str:
    with pytest.raises(NotRewritten) as caught:
        rewriter.rewrite(prompt)
    return caught.value.message


def test_the_endpoint_is_asked_for_a_caption_in_the_style_of_the_training_captions(model: LanguageModel) -> None:
    assert rewriter_of(model).rewrite(PROMPT).text == CAPTION
    (asked,) = model.asked
    assert asked.path == "/v1/chat/completions"
    assert asked.authorization == f"Bearer {KEY}"
    assert asked.question["model"] == "some-model"
    assert [m["role"] for m in asked.question["messages"]] == ["system", "user"]
    assert "A youth waves hi with the left hand." in asked.question["messages"][0]["content"]
    assert asked.prompt == PROMPT


def test_an_alignment_is_asked_for_the_actions_of_the_vocabulary(
    model: LanguageModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Settings(rewriter="tca", rewriter_url=model.url, rewriter_model="some-model")
    monkeypatch.setattr(loading, "settings", lambda: config)
    model.answer = lambda asked, before: CompletionReply("A person walks to the left.")
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"rewriter": "tca"})
    rewriter = load_rewriter("tca", pipeline.labeller)
    aligned = TextPipeline(spec, rewriter=rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)
    (parsed,) = aligned.explain(["he strolls to the left"])
    assert parsed.graph.text == "A person walks to the left."
    assert parsed.rewrite_reason == "rewritten by the rewriter 'tca'"
    instruction = model.asked[0].question["messages"][0]["content"]
    assert "A youth waves hi with the left hand." in instruction
    for action in load_vocabulary().actions.values():
        assert not action.verbs or action.verbs[0] in instruction
    assert "{" not in instruction
    with pytest.raises(InvalidBundle, match="'tca' writes captions"):
        load_rewriter("tca", pipeline.labeller, "description")


def test_a_bundle_shows_the_captions_of_its_own_data(model: LanguageModel, monkeypatch: pytest.MonkeyPatch) -> None:
    own = ("The actor {braces} strides off.", "Somebody ducks and stays low for a while.")
    config = Settings(rewriter_url=model.url, rewriter_model="some-model")
    monkeypatch.setattr(loading, "settings", lambda: config)
    labeller = shared_pipeline().labeller
    for name in ("openai", "tca"):
        load_rewriter(name, labeller, style=own).rewrite(f"{PROMPT} {name}")
        instruction = model.asked[-1].question["messages"][0]["content"]
        assert "these captions:\n- The actor {braces} strides off.\n- Somebody ducks" in instruction
        assert "A youth waves hi" not in instruction
    assert alignment(load_vocabulary(), own).instruction == instruction
    assert question_of("description", own).instruction == question_of("description").instruction


def test_the_style_is_part_of_the_key_of_features_where_a_language_model_is_asked() -> None:
    sha256 = "0" * 64

    def key(**values: object) -> str:
        return feature_key(
            "walk", TextSpec.model_validate({"encoder_sha256": sha256, "labeller_sha256": sha256, **values})
        )

    assert key(style=("a person strides",)) == key()
    assert len({key(rewriter="tca", style=style) for style in ((), ("a b c",), ("a b d",))}) == 3
    assert "style" not in TextSpec().model_dump()
    with pytest.raises(ValidationError):
        TextSpec(style=("a person walks\nand obeys",))


DESCRIBED = "The person shuffles forward, the left foot dragging behind, with both arms hanging loosely at the sides."


def rewrite_of(answer: str) -> Rewrite:
    with LanguageModel(lambda asked, before: CompletionReply(answer)) as model:
        made = OpenAIRewriter(Endpoint(model.url, "some-model", None, 5.0), question_of("description")).rewrite(
            "zombie walk"
        )
        (asked,) = model.asked
        assert "about 60 words" in asked.question["messages"][0]["content"]
    return made


@pytest.mark.parametrize("length", ["6", "6 seconds", "6.0 s."])
def test_a_description_comes_with_the_length_of_the_motion(length: str) -> None:
    assert rewrite_of(f"Motion: {DESCRIBED}\nSeconds: {length}") == Rewrite(DESCRIBED, 6.0)


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (DESCRIBED, "a line of motion and a line of seconds"),
        (f"Motion: {DESCRIBED}\nSeconds: a while", "no length in seconds"),
        (f"Motion: {DESCRIBED}\nSeconds: 0", "no length in seconds"),
        (f"Motion: {DESCRIBED}\nSeconds: 600", "no length in seconds"),
        (f"Motion: {'step ' * 101}\nSeconds: 6", "more than 100 words"),
        (f"Motion: {DESCRIBED}\nSeconds: 6\nSeconds: 7", "a line of motion and a line of seconds"),
    ],
)
def test_other_answers_are_no_descriptions(answer: str, reason: str) -> None:
    with pytest.raises(NotRewritten, match=reason):
        rewrite_of(answer)


def test_a_prompt_is_asked_once(model: LanguageModel) -> None:
    rewriter = rewriter_of(model)
    assert [rewriter.rewrite(PROMPT).text for _ in range(3)] == [CAPTION] * 3
    assert len(model.asked) == 1


def test_the_oldest_answers_are_forgotten(model: LanguageModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openai_rewriter, "CACHED", 2)
    rewriter = rewriter_of(model)
    for prompt in ("a", "b", "a", "c", "a", "b"):
        rewriter.rewrite(prompt)
    assert [asked.prompt for asked in model.asked] == ["a", "b", "c", "b"]


@pytest.mark.parametrize("status", [429, 500, 503])
def test_a_busy_endpoint_is_asked_again(model: LanguageModel, status: int) -> None:
    model.answer = lambda asked, before: CompletionReply(CAPTION) if before else CompletionReply("", status=status)
    assert rewriter_of(model).rewrite(PROMPT).text == CAPTION
    assert len(model.asked) == 2


def test_as_long_as_the_endpoint_asks_for_is_waited(model: LanguageModel, monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr(openai_rewriter.time, "sleep", slept.append)
    model.answer = lambda asked, before: CompletionReply(CAPTION if before else "", status=200 if before else 429,
                                                headers={} if before else {"Retry-After": "7"})  # fmt: skip
    rewriter_of(model).rewrite(PROMPT)
    assert slept == [7.0]


def test_nobody_waits_longer_than_a_prompt_may_take(model: LanguageModel) -> None:
    model.answer = lambda asked, before: CompletionReply("", status=429, headers={"Retry-After": "3600"})
    assert "429" in reason_of(rewriter_of(model))
    assert len(model.asked) == 1


@pytest.mark.parametrize(("status", "asked"), [(500, TRIES), (401, 1), (404, 1), (302, 1)])
def test_a_status_that_stays_is_the_reason(model: LanguageModel, status: int, asked: int) -> None:
    model.answer = lambda asked, before: CompletionReply("", status=status, headers={"Location": "http://127.0.0.1:1/"})
    assert str(status) in reason_of(rewriter_of(model))
    assert len(model.asked) == asked


@pytest.mark.parametrize("delay", [0.05, 60.0])
def test_a_slow_answer_is_not_waited_for(model: LanguageModel, delay: float) -> None:
    model.answer = lambda asked, before: CompletionReply(CAPTION, delay=delay)
    assert "within 0.3 s" in reason_of(rewriter_of(model, seconds=0.3))


def test_an_endpoint_that_is_not_there_is_the_reason() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}/v1"
    assert "cannot be reached" in reason_of(OpenAIRewriter(Endpoint(url, "m", None), question_of("caption")))


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (CompletionReply(body=b"<html>welcome</html>"), "not a chat completion"),
        (CompletionReply(body=b"[" * 50_000), "not a chat completion"),
        (CompletionReply(body=b"\xff\xfe\x00"), "not a chat completion"),
        (CompletionReply(body=b'{"choices": []}'), "not a chat completion"),
        (CompletionReply(body=b'{"choices": [{"message": {"content": null}}]}'), "no text"),
        (CompletionReply(body=b"x" * (MAX_ANSWER_BYTES + 1)), "too long"),
        (CompletionReply(""), "0 lines"),
        (CompletionReply("Sure!\n\nA person walks."), "2 lines"),
        (CompletionReply("走路的人"), "no English words"),
        (CompletionReply("a person \x00 walks"), "NUL"),
        (CompletionReply("walk " * 80), "more than 60 words"),
    ],
)
def test_rubbish_is_no_caption(model: LanguageModel, answer: CompletionReply, reason: str) -> None:
    model.answer = lambda asked, before: answer
    assert reason in reason_of(rewriter_of(model))


@pytest.mark.parametrize("said", [f'"{CAPTION}"', f"- {CAPTION}", f"\n  {CAPTION}\n"])
def test_what_models_like_to_put_around_a_caption_is_taken_off(model: LanguageModel, said: str) -> None:
    model.answer = lambda asked, before: CompletionReply(said)
    assert rewriter_of(model).rewrite(PROMPT).text == CAPTION


def test_an_endpoint_that_fails_again_and_again_is_left_alone(
    model: LanguageModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    model.answer = lambda asked, before: CompletionReply("", status=401)
    rewriter = rewriter_of(model)
    for number in range(REST_AFTER + 5):
        reason_of(rewriter, f"walk {number}")
    assert len(model.asked) == REST_AFTER
    assert "left alone" in reason_of(rewriter, "run")
    now = openai_rewriter.time.monotonic()
    monkeypatch.setattr(openai_rewriter.time, "monotonic", lambda: now + 31)
    model.answer = lambda asked, before: CompletionReply(CAPTION)
    assert rewriter.rewrite("run").text == CAPTION


def test_several_prompts_are_asked_for_at_once_and_each_once(model: LanguageModel) -> None:
    prompts = [f"walk {number} steps" for number in range(3 * AT_ONCE)]

    def answer(asked: ChatRequest, before: int) -> CompletionReply:
        return CompletionReply(f"A person goes {asked.prompt}.", status=404 if asked.prompt == prompts[5] else 200)

    model.answer = answer
    rewriter = rewriter_of(model)
    rewriter.prefetch([*prompts, *prompts])
    rewriter.prefetch(prompts[:10])  # one answer is an error that waits to be raised
    assert sorted(asked.prompt for asked in model.asked) == sorted(prompts)
    for prompt in prompts:
        if prompt == prompts[5]:
            assert "404" in reason_of(rewriter, prompt)
        else:
            assert rewriter.rewrite(prompt).text == f"A person goes {prompt}."
    assert len(model.asked) == len(prompts)


def test_neither_key_nor_prompt_is_told_to_the_log(model: LanguageModel, caplog: pytest.LogCaptureFixture) -> None:
    model.answer = lambda asked, before: CompletionReply("", status=401)
    rewriter = rewriter_of(model)
    pipeline = shared_pipeline()
    pipeline.rewriter = rewriter
    with caplog.at_level(logging.DEBUG):
        for number in range(REST_AFTER + 1):
            pipeline.features([f"{PROMPT} {number}"])
    assert "not rewritten" in caplog.text
    assert KEY not in caplog.text + repr(rewriter.__dict__)
    assert PROMPT not in caplog.text


@pytest.mark.parametrize(
    ("caption", "reason"),
    [(CAPTION, None), ("A person strolls to the right.", "side"), ("A person runs to the left.", "verbs")],
)
def test_a_caption_that_says_something_else_is_not_used(model: LanguageModel, caption: str, reason: str | None) -> None:
    prompt = "he strolls to the left"
    model.answer = lambda asked, before: CompletionReply(caption)
    pipeline = shared_pipeline()
    pipeline.rewriter = rewriter_of(model)
    (features,) = pipeline.features([prompt])
    assert features.prompt == prompt
    assert features.rewritten == (prompt if reason else caption)
    assert features.graph.text == features.rewritten
    assert (features.not_rewritten is None) == (reason is None)
    assert (reason or "") in (features.not_rewritten or "")
    assert TextFeatures.from_blob(features.to_blob()).not_rewritten == features.not_rewritten


def test_a_machine_chooses_its_rewriter_and_the_keys_of_features_tell_which() -> None:
    sha256 = "0" * 64
    spec = TextSpec(encoder_sha256=sha256, labeller_sha256=sha256)

    def served(**values: str) -> TextSpec:
        return as_served(spec, config=Settings.model_validate(values))

    assert served() == spec
    specs = [served(rewriter=name, rewriter_model=model)
             for name, model in (("none", "a"), ("rules", "a"), ("openai", "a"), ("openai", "b"), ("tca", "a"),
                                 ("tca", "b"))]  # fmt: skip
    assert [s.rewriter for s in specs] == ["none", "rules", "openai", "openai", "tca", "tca"]
    assert len({feature_key("walk", s) for s in specs}) == 6
    assert feature_key("walk", specs[0]) == feature_key("walk", spec)


def test_no_language_model_is_asked_where_none_is_named() -> None:
    with pytest.raises(InvalidInput) as caught:
        Endpoint.of(Settings())
    assert caught.value.where == "MAREY_REWRITER_MODEL"
