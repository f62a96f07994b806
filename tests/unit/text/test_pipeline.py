"""From prompts to features."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.bundles import TextSpec
from marey.core.errors import InvalidBundle, InvalidInput, NotFound
from marey.text import pipeline as pipelines
from marey.text.keys import feature_key, resolve
from marey.text.pipeline import TextPipeline
from tests.support.texts import shared_pipeline

PROMPTS = ("a person walks forward", "someone waves the left hand, then bows.", "A MAN KICKS", "zombie")


@pytest.fixture(scope="module")
def pipeline() -> TextPipeline:
    return shared_pipeline()


def test_features_have_a_row_a_node_and_the_sentence_first(pipeline: TextPipeline) -> None:
    for features in pipeline.features(PROMPTS):
        assert features.nodes.shape == (len(features.graph.nodes), 384)
        assert np.allclose(features.sentence, pipeline.pooled([features.graph.text])[0], atol=1e-3)


def test_features_are_equal_in_any_batch_and_order(pipeline: TextPipeline) -> None:
    fresh = TextPipeline.load(TextSpec())
    together = [f.to_blob() for f in pipeline.features(PROMPTS)]
    backwards = [f.to_blob() for f in fresh.features(PROMPTS[::-1])][::-1]
    alone = [shared_pipeline().features([PROMPTS[1]])[0].to_blob()]
    assert together == backwards
    assert together[1] == alone[0]


def test_threads_share_a_pipeline_and_its_parts_see_one_at_a_time(
    pipeline: TextPipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    busy, met = threading.Lock(), threading.Event()

    def alone(function: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: Any) -> Any:
            if not busy.acquire(blocking=False):
                met.set()
                return function(*args)
            try:
                met.wait(0.02)  # time for another one to come
                return function(*args)
            finally:
                busy.release()

        return called

    for name, load, method in (
        ("labeller", pipelines.load_labeller, "label"),
        ("encoder", pipelines.load_encoder, "pooled"),
    ):

        def loaded(*args: Any, load: Callable[..., Any] = load, method: str = method) -> Any:
            part = load(*args)
            monkeypatch.setattr(part, method, alone(getattr(part, method)))
            return part

        with monkeypatch.context() as patch:
            patch.setattr(pipelines, f"load_{name}", loaded)
            shared = TextPipeline.load(TextSpec())
        with ThreadPoolExecutor(len(PROMPTS)) as pool:
            found = list(pool.map(lambda prompt, shared=shared: shared.features([prompt])[0].to_blob(), PROMPTS))
        assert not met.is_set(), name
        assert found == [features.to_blob() for features in pipeline.features(PROMPTS)]


def test_punctuation_at_the_end_does_not_change_a_vector(pipeline: TextPipeline) -> None:
    assert np.array_equal(*pipeline.pooled(["to the left.", "to the left"]))


def test_span_features_are_the_sentence_s_own_states(pipeline: TextPipeline) -> None:
    spans = TextPipeline(
        TextSpec(node_features="span"), rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder
    )
    text = '"A person walks forward."'
    (features,) = spans.features([text])
    sentence = pipeline.encoder.encode(text.strip('".'))
    node = next(n for n in features.graph.nodes if n.text == "walks")
    expected = sentence.span(9, 14)
    assert expected is not None
    assert np.allclose(features.nodes[node.id], expected, atol=1e-3)
    assert not np.allclose(features.nodes[node.id], pipeline.pooled(["walks"])[0], atol=1e-2)


def test_a_prompt_of_several_acts_is_read_in_the_order_of_time_where_the_bundle_says_so(pipeline: TextPipeline) -> None:
    ordered = TextPipeline(
        TextSpec(in_order=True), rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder
    )
    late, one = "Before bowing, she walks ahead.", "a person walks forward"
    plain, read = pipeline.features([late, one]), ordered.features([late, one])
    assert [f.graph.text for f in read] == ["she walks ahead, and then a person is bowing.", one]
    assert [f.prompt for f in read] == [late, one]
    assert read[0].actions == plain[0].actions == ("she walks ahead", "a person is bowing")
    assert ordered.parse([late])[0] == read[0].graph
    assert read[1].to_blob() == plain[1].to_blob()


def test_the_key_is_known_without_a_model_and_changes_with_everything(pipeline: TextPipeline) -> None:
    spec = resolve(TextSpec())
    assert spec == pipeline.spec
    key = pipeline.key("  a person   walks ")
    assert key == feature_key("a person walks", spec)
    changes = (
        {"rewriter": "rules"},
        {"node_features": "span"},
        {"in_order": True},
        {"max_actions": 4},
        {"encoder_sha256": "0" * 64},
        {"labeller_sha256": "0" * 64},
    )
    keys = {feature_key("a person walks", spec.model_copy(update=change)) for change in changes}
    assert len(keys | {key, feature_key("a person runs", spec)}) == len(changes) + 2


def test_a_key_needs_hashes() -> None:
    with pytest.raises(InvalidBundle, match="does not say"):
        feature_key("a person walks", TextSpec())


def test_keys_and_limits_need_no_torch() -> None:
    code = (
        "import sys; from marey.bundles import TextSpec; import marey.text.pipeline, marey.items.prompts; "
        "from marey.text.keys import resolve; resolve(TextSpec()); "
        "print([m for m in ('torch', 'transformers', 'tokenizers') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_another_labeller_than_the_bundle_names_is_refused() -> None:
    with pytest.raises(InvalidBundle, match="trained with labeller"):
        TextPipeline.load(TextSpec(labeller_sha256="0" * 64))


def test_a_labeller_that_is_not_there_is_named() -> None:
    with pytest.raises(NotFound, match="srl-bert") as caught:
        TextPipeline.load(TextSpec(labeller="bert-srl"))
    assert "marey models import allennlp-srl" in str(caught.value.hint)


def test_one_bad_prompt_is_an_error_before_any_work(pipeline: TextPipeline) -> None:
    with pytest.raises(InvalidInput):
        pipeline.features(["a person walks", ""])


@settings(max_examples=80, deadline=None)
@given(st.text(max_size=120) | st.lists(st.sampled_from(
    ["a", "person", "WALKS", "fwd", "forward.", "and", "wavs", "👋", "left,", "!!", "2m", "très", "then"]
)).map(" ".join))  # fmt: skip
def test_any_text_gives_a_graph_or_a_clear_error(pipeline: TextPipeline, prompt: str) -> None:
    try:
        (graph,) = pipeline.parse([prompt])
    except InvalidInput:
        return
    graph.validate()
    assert graph.words == tuple(graph.text.split())
    assert pipeline.encode(graph).shape == (len(graph.nodes), 384)
    assert np.isfinite(pipeline.encode(graph)).all()
