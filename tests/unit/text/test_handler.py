"""The work of the `text` queue."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from uuid import UUID, uuid4

import numpy as np
import pytest

from marey.bundles import BundleWriter, TextSpec
from marey.core.errors import InvalidBundle
from marey.items.timeline import read_timeline, timeline_text
from marey.jobs import Claim, ClaimedItem, Edits, ItemStage
from marey.jobs.types import UNREAD
from marey.runtime.handler import Batch, Failed, Outcome, TextDone
from marey.text.features import TextFeatures
from marey.text.keys import feature_key, resolve, scope_key
from marey.text.several import SeveralTexts, several_key
from marey.text_service.handler import TextHandler, create_handler
from marey.vocabulary.scope import ActionLists, ScopePolicy
from tests.support.texts import pipelines_share_parts


def write_bundle(path: Path, text: TextSpec | None, actions: ActionLists | None = None) -> str:
    with BundleWriter(path) as writer:
        writer.add_part("masked", {"weight": np.zeros((1, 1), np.float32)})
        writer.finish(
            name=path.name, version="1", kind="generator", model="hgm3", config="tiny", parameters={}, text=text,
            licence="MIT", actions=actions,
        )  # fmt: skip
    return str(path)


@pytest.fixture(autouse=True, scope="module")
def _shared_parts() -> Iterator[None]:
    with pipelines_share_parts():
        yield


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_bundle(tmp_path_factory.mktemp("models") / "tiny", TextSpec())


@pytest.fixture(scope="module")
def handler(bundle: str) -> TextHandler:
    made = create_handler()
    made.load(bundle)
    return made


def items(*prompts: str, key: str | None = None) -> tuple[ClaimedItem, ...]:
    spec = resolve(TextSpec())
    return tuple(
        ClaimedItem(
            id=uuid4(), position=i, index=i, variant=0, name=None, prompt=prompt, model="hgm3", bundle="tiny",
            text_key=key or feature_key(prompt, spec), seed=0, seconds=None, settings={}, tags=(), attempts=0,
        )
        for i, prompt in enumerate(prompts)
    )  # fmt: skip


def batch(claimed: tuple[ClaimedItem, ...]) -> Batch:
    claim = Claim(uuid4(), "default", uuid4(), "text", ItemStage.TEXT, "key", "tiny", solo=False, items=claimed)
    return Batch(claim, claimed, {})


class FakeControl:
    """Says which items were cancelled, and counts progress."""

    def __init__(self) -> None:
        self.gone: set[UUID] = set()
        self.seen: list[tuple[int, int]] = []

    def progress(self, done: int, total: int) -> None:
        self.seen.append((done, total))

    def dropped(self) -> frozenset[UUID]:
        return frozenset(self.gone)


def test_each_prompt_gets_its_features_under_its_key(handler: TextHandler) -> None:
    claimed = items("a person walks forward", "someone bows")
    control = FakeControl()
    outcomes = list(handler.run(batch(claimed), control))
    assert [(o.item, o.key) for o in outcomes if isinstance(o, TextDone)] == [(i.id, i.text_key) for i in claimed]
    read = TextFeatures.from_blob(outcomes[0].blob)  # type: ignore[union-attr]
    assert read.prompt == "a person walks forward"
    assert read.nodes.shape[1] == 384
    assert control.seen[-1] == (2, 2)


def test_a_prompt_that_cannot_be_used_fails_alone_and_for_good(handler: TextHandler) -> None:
    claimed = (*items("a person walks"), *items("走", key="0" * 64), *items("someone bows"))
    outcomes = {outcome.item: outcome for outcome in handler.run(batch(claimed), FakeControl())}
    done, failed, last = (outcomes[item.id] for item in claimed)
    assert isinstance(done, TextDone)
    assert isinstance(last, TextDone)
    assert isinstance(failed, Failed)
    assert not failed.retryable
    assert "no English words" in failed.problem.message


def test_a_job_taken_with_other_weights_is_not_given_wrong_features(handler: TextHandler) -> None:
    (failed,) = handler.run(batch(items("a person walks", key="0" * 64)), FakeControl())
    assert isinstance(failed, Failed)
    assert "another text encoder or labeller" in failed.problem.message


def test_items_dropped_on_the_way_are_left_out(handler: TextHandler) -> None:
    claimed = items("a person walks", "someone bows", "a man kicks")
    control = FakeControl()
    running: Iterator[object] = handler.run(batch(claimed), control)
    next(running)
    control.gone = {claimed[1].id}
    assert [o.item for o in running] == [claimed[2].id]  # type: ignore[attr-defined]


def timeline(*prompts: str, **changes: object) -> tuple[ClaimedItem, ...]:
    """An item of these prompts, two seconds each."""
    rows = read_timeline([{"start": 2 * n, "end": 2 * n + 2, "prompt": text} for n, text in enumerate(prompts)])
    (item,) = items(timeline_text(rows), key=several_key(feature_key(text, resolve(TextSpec())) for text in prompts))
    return (replace(item, timeline=rows, **changes),)  # pyright: ignore[reportArgumentType]


def test_the_rows_of_a_timeline_are_read_one_by_one(handler: TextHandler) -> None:
    claimed = (*timeline("a person walks", "a person bows"), *items("someone kicks"))
    first, second = handler.run(batch(claimed), FakeControl())
    assert isinstance(first, TextDone)
    assert isinstance(second, TextDone)
    assert first.key == claimed[0].text_key
    texts = SeveralTexts.from_blob(first.blob).texts
    assert [text.prompt for text in texts] == ["a person walks", "a person bows"]
    (alone,) = handler.run(batch(items("a person bows")), FakeControl())
    assert isinstance(alone, TextDone)
    assert texts[1].to_blob() == alone.blob
    assert TextFeatures.from_blob(second.blob).prompt == "someone kicks"


def test_a_timeline_taken_with_other_weights_is_refused(handler: TextHandler) -> None:
    (failed,) = handler.run(batch(timeline("a person walks", text_key="0" * 64)), FakeControl())
    assert isinstance(failed, Failed)


def test_a_claim_is_one_bucket(handler: TextHandler) -> None:
    claimed = items("a person walks", "someone bows")
    assert handler.buckets(batch(claimed)) == [claimed]
    assert handler.batch_size == 64


def test_a_bundle_that_reads_no_prompts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidBundle, match="does not read prompts"):
        create_handler().load(write_bundle(tmp_path / "mute", None))


def test_a_bundle_of_other_weights_is_refused_on_loading(tmp_path: Path) -> None:
    path = write_bundle(tmp_path / "other", TextSpec(encoder_sha256="0" * 64))
    with pytest.raises(InvalidBundle, match="trained with encoder"):
        create_handler().load(path)


# --- scope ---

LISTS = ActionLists(("walk", "bow", "wave"), tried=("kick",))


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_bundle(tmp_path_factory.mktemp("models") / "listed", TextSpec(), LISTS)


def judge(bundle: str, policy: ScopePolicy, *prompts: str) -> list[Outcome]:
    return judge_items(bundle, policy, items(*prompts))


def judge_items(bundle: str, policy: ScopePolicy, asked: tuple[ClaimedItem, ...]) -> list[Outcome]:
    made = create_handler()
    made.load(bundle)
    claimed = tuple(replace(item, bundle=bundle) for item in asked)
    claim = Claim(
        uuid4(), "default", uuid4(), "text", ItemStage.TEXT, "key", bundle, solo=False, items=claimed, scope=policy
    )
    return list(made.run(Batch(claim, claimed, {}), FakeControl()))


def test_the_encoder_decides_what_the_words_leave(listed: str) -> None:
    thing, act, clear = judge(listed, "warn", "a wave of nausea", "a low bow", "a person walks")
    assert isinstance(thing, TextDone)
    assert thing.scope is not None
    assert (thing.scope.scope["by"], thing.scope.scope["verdict"]) == ("encoder", "unknown")
    assert thing.scope.key == scope_key("a wave of nausea", listed, LISTS)
    assert isinstance(act, TextDone)
    assert act.scope is not None
    assert act.scope.scope["verdict"] == "known"
    assert isinstance(clear, TextDone)
    assert clear.scope is None


def test_the_encoder_s_verdict_keeps_the_flag_of_a_length_out_of_range(listed: str) -> None:
    long, short = judge(listed, "warn", "a low bow for two minutes", "a low bow for two seconds")
    assert isinstance(long, TextDone)
    assert long.scope is not None
    assert long.scope.scope["flags"] == ["length"]
    assert isinstance(short, TextDone)
    assert short.scope is not None
    assert short.scope.scope["flags"] == []


def test_refuse_fails_what_the_encoder_finds_unknown_for_good(listed: str) -> None:
    failed, done = judge(listed, "refuse", "a wave of nausea", "a low bow")
    assert isinstance(failed, Failed)
    assert (failed.retryable, failed.problem.problem_type) == (False, "out-of-scope")
    named = "names an action that the model does not know: 'a wave of nausea' (no-action)"
    assert failed.problem.message == f"the prompt {named}"
    assert failed.problem.hint == "listed knows: walk, bow, wave."
    assert isinstance(done, TextDone)


def test_the_rows_of_a_timeline_are_judged_one_by_one(listed: str) -> None:
    rows = ("a person walks", "a wave of nausea")
    (done,) = judge_items(listed, "warn", timeline(*rows))
    assert isinstance(done, TextDone)
    assert done.scope is not None
    assert (done.scope.scope["verdict"], done.scope.scope["by"]) == ("unknown", "encoder")
    assert [row["verdict"] for row in done.scope.scope["rows"]] == ["known", "unknown"]
    text = "0-2 a person walks; 2-4 a wave of nausea"
    assert done.scope.key == scope_key(text, listed, LISTS, in_rows=True) != scope_key(text, listed, LISTS)
    (failed,) = judge_items(listed, "refuse", timeline(*rows))
    assert isinstance(failed, Failed)
    named = "names an action that the model does not know: 'a wave of nausea' (no-action)"
    assert failed.problem.message == f"row 2 (2-4) {named}"
    (clear,) = judge_items(listed, "warn", timeline("a person walks", "a person walks"))
    assert isinstance(clear, TextDone)
    assert clear.scope is None


def edit(*prompts: str) -> tuple[ClaimedItem, ...]:
    """An item that edits a motion: an extension by each prompt, and a repaint without one."""
    ops = [{"op": "extend", "seconds": 1, "prompt": prompt} for prompt in prompts]
    key = several_key(feature_key(text, resolve(TextSpec())) for text in prompts or (UNREAD,))
    (item,) = items("a person stumbles, then " + ", then ".join(prompts), key=key)
    return (replace(item, edits=Edits((*ops, {"op": "repaint", "from": 1}), (uuid4(),))),)


def test_the_prompts_of_an_edit_are_judged_one_by_one(listed: str) -> None:
    (done,) = judge_items(listed, "warn", edit("a person walks", "a wave of nausea"))
    assert isinstance(done, TextDone)
    assert done.scope is not None
    assert (done.scope.scope["verdict"], done.scope.scope["by"]) == ("unknown", "encoder")
    assert [row["verdict"] for row in done.scope.scope["rows"]] == ["known", "unknown"]
    assert done.scope.key == scope_key("a person walks\na wave of nausea", listed, LISTS, of_edit=True)
    (one,) = judge_items(listed, "warn", edit("a low bow"))
    assert isinstance(one, TextDone)
    assert one.scope is not None
    assert (one.scope.scope["verdict"], "rows" in one.scope.scope) == ("known", False)
    assert one.scope.key == scope_key("a low bow", listed, LISTS, of_edit=True) != scope_key("a low bow", listed, LISTS)
    (failed,) = judge_items(listed, "refuse", edit("a wave of nausea"))
    assert isinstance(failed, Failed)
    named = "names an action that the model does not know: 'a wave of nausea' (no-action)"
    assert failed.problem.message == f"the prompt {named}"


def test_an_edit_without_a_prompt_or_with_clear_words_gets_no_verdict(listed: str) -> None:
    for asked in (edit(), edit("a person walks")):
        (done,) = judge_items(listed, "refuse", asked)
        assert isinstance(done, TextDone)
        assert done.scope is None


def test_prompts_that_are_not_examined_and_bundles_without_lists_get_no_verdict(listed: str, bundle: str) -> None:
    cases: tuple[tuple[str, ScopePolicy], ...] = ((listed, "ignore"), (bundle, "warn"))
    for path, policy in cases:
        (done,) = judge(path, policy, "a wave of nausea")
        assert isinstance(done, TextDone)
        assert done.scope is None
