"""The text pipeline from prompt to features: rewriter, labeller, graph, encoder."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from marey.bundles import TextSpec
from marey.core.errors import InvalidBundle
from marey.items.prompts import check_prompt
from marey.text.action_reader import action_reader
from marey.text.actions import split_actions
from marey.text.asides import without_asides
from marey.text.beside_postures import with_posture_first
from marey.text.by_context import with_words_by_context
from marey.text.clause_normalization import join_in_order
from marey.text.elided_words import with_elided
from marey.text.encoded_texts import EncodedTexts
from marey.text.encoders import Encoding, TextEncoder
from marey.text.features import TextFeatures
from marey.text.graph import Node, SemanticGraph, build_graph
from marey.text.guard import changed_but_aligned, changed_meaning, lost_meaning
from marey.text.held_hand import with_hand_again
from marey.text.in_place_words import with_plain_gait_in_place
from marey.text.kept_texts import KEPT, KeptTexts
from marey.text.keys import NO_LABELLER, feature_key
from marey.text.known_verbs import with_known_verbs
from marey.text.labellers import OneAtATime
from marey.text.left_out import may_leave_out, parts_left_out
from marey.text.loading import load_encoder, load_labeller, load_rewriter
from marey.text.misleading_words import without_misleading
from marey.text.notes import with_notes_told
from marey.text.order_reader import FILE as ORDER_FILE
from marey.text.parsed import ParsedPrompt, warnings_of, without_punctuation
from marey.text.plain_action import only_action, with_subject
from marey.text.plain_phrases import with_plain_phrases
from marey.text.reading_encoder import reading_encoder
from marey.text.readings import ReadPrompt, TrainedReaders
from marey.text.rewriters import NotRewritten, PromptRewriter, Rewrite
from marey.text.roles import Frame, RoleLabeller
from marey.text.sequence_reader import ReadMovement
from marey.text.stunt_words import with_plain_stunts
from marey.text.time_order import in_time_order
from marey.text.winding_ways import with_plain_zigzag
from marey.text.word_order import in_usual_order
from marey.text.words import EDGE_PUNCTUATION
from marey.vocabulary.take_names import as_words

if TYPE_CHECKING:
    from marey.text.spelling import Speller

log = logging.getLogger(__name__)

TOGETHER = 64
"""Prompts whose texts are encoded together."""


@lru_cache(maxsize=KEPT)
def _in_known_words(prompt: str) -> str:
    """Return a prompt as the readers know it: in the order of time, with the words that it leaves out, without those
    that mislead them, and with plain words of ways that wind and of gaits in place."""
    said = with_known_verbs(
        with_plain_phrases(
            with_plain_stunts(
                with_posture_first(with_words_by_context(with_notes_told(without_asides(as_words(prompt)))))
            )
        )
    )
    ordered = with_hand_again(with_elided(in_time_order(in_usual_order(said))))
    return without_misleading(with_plain_gait_in_place(with_plain_zigzag(ordered)))


class TextPipeline:
    """Turn prompts into graphs and features.

    A vector depends on its text alone, so features are equal in any batch. Thread-safe when made by `load`: labeller
    and encoder serve one thread at a time, and a thread that waits for a rewriter blocks no other.
    """

    def __init__(
        self, spec: TextSpec, *, rewriter: PromptRewriter, labeller: RoleLabeller, encoder: TextEncoder
    ) -> None:
        """Put a pipeline together from parts; most callers want `load`.

        Raises:
            InvalidBundle: the weights or the width are not those `spec` names.
        """
        refuse_mismatch("encoder", spec.encoder, spec.encoder_sha256, encoder.name, encoder.sha256)
        if encoder.width != spec.width:
            raise InvalidBundle(f"text width {spec.width} is wanted, but {encoder.name} gives {encoder.width}")
        labeller_sha256 = labeller.sha256 or None
        if spec.labeller != NO_LABELLER:
            refuse_mismatch("labeller", labeller.name, spec.labeller_sha256, labeller.name, labeller.sha256)
        self.spec = spec.model_copy(update={"encoder_sha256": encoder.sha256, "labeller_sha256": labeller_sha256})
        self.rewriter = rewriter
        self.labeller = labeller
        self.encoder = encoder
        self._speller: Speller | None = None
        self._texts = EncodedTexts(encoder)
        self._texts_to_read, self._texts_to_order = self._encoded_for_readers()
        self._kept_readings = KeptTexts[ReadPrompt]()
        self._kept_frames = KeptTexts[tuple[Frame, ...]]()
        self._kept_parts = KeptTexts[tuple[str, ...]]()

    @classmethod
    def load(cls, spec: TextSpec, *, encoder_path: Path | None = None) -> TextPipeline:
        """Load the pipeline that a bundle's manifest declares, with the weights found on this machine.

        Args:
            spec: names, hashes and caps. Open hashes are filled in `pipeline.spec`.
            encoder_path: a folder of encoder weights; None = wherever they are installed.

        Raises:
            NotFound: weights are not installed; the hint says how to get them.
            InvalidBundle: other weights are installed than `spec` names.
        """
        labeller = OneAtATime(load_labeller(spec.labeller))
        return cls(
            spec,
            rewriter=load_rewriter(spec.rewriter, labeller, spec.wording, spec.style),
            labeller=labeller,
            encoder=load_encoder(spec.encoder, encoder_path),
        )

    def key(self, prompt: str) -> str:
        """Key of the prompt's features: sha256 over the prompt and all that its features depend on."""
        return feature_key(check_prompt(prompt, stored=True), self.spec)

    def parse(self, prompts: Sequence[str]) -> list[SemanticGraph]:
        """Parse each prompt into its graph, rewritten first.

        Raises:
            InvalidInput: a prompt cannot be used (`check_prompt`).
        """
        return [parsed.graph for parsed in self.explain(prompts)]

    def explain(self, prompts: Sequence[str]) -> list[ParsedPrompt]:
        """The graph of each prompt, with why its text differs from the prompt, and warnings.

        Raises:
            InvalidInput: a prompt cannot be used (`check_prompt`).
        """
        checked = [check_prompt(prompt, stored=True) for prompt in prompts]
        rewritten = self._rewritten(checked)
        readings = self._readings([each.text for each in rewritten])
        graphs = [graph for graph, _ in self._read(readings)]
        return [
            ParsedPrompt(
                prompt,
                graph,
                self._rewrite_reason(prompt, rewrite, reading, graph),
                self._warnings(graph),
                tuple(each.worded for each in reading.movements),
            )
            for prompt, rewrite, reading, graph in zip(checked, rewritten, readings, graphs, strict=True)
        ]

    def _rewrite_reason(self, prompt: str, rewrite: Rewrite, reading: ReadPrompt, graph: SemanticGraph) -> str | None:
        """Reason why `graph.text` differs from `prompt`, or why a rewrite was not used."""
        reasons: list[str] = []
        if rewrite.text != prompt:
            reasons.append(f"rewritten by the rewriter {self.rewriter.name!r}")
        if rewrite.refused is not None:
            reasons.append(f"the rewrite of {self.rewriter.name!r} was not used: {rewrite.refused}")
        if reading.drawn:
            reasons.append("manners and gestures are drawn on the motion, and not read")
        worded = reading.worded
        if worded == with_subject(rewrite.text) != rewrite.text:
            reasons.append("the verb gets its subject, as captions have one")
        elif worded != rewrite.text:
            reasons.append("the model knows the action by these plain words")
        if graph.text != worded:
            reasons.append("the model reads several actions as one sentence each, in the order of time")
        return "; ".join(reasons) or None

    def _warnings(self, graph: SemanticGraph) -> tuple[str, ...]:
        return () if self.spec.labeller == NO_LABELLER else warnings_of(graph)

    def prefetch(self, prompts: Sequence[str]) -> None:
        """Get ready to read these prompts one by one."""
        self.rewriter.prefetch(prompts)
        if self._texts_to_read is not None and self.spec.rewriter == "none":
            self._texts_to_read.pooled([_in_known_words(prompt) for prompt in prompts])  # together, in half the time

    def _rewritten(self, prompts: Sequence[str]) -> list[Rewrite]:
        if len(prompts) > 1:
            self.prefetch(prompts)
        return [self.rewrite(prompt) for prompt in prompts]

    def rewrite(self, prompt: str) -> Rewrite:
        """Rewrite a prompt for the model; with a reason if the rewriter ran and its result was not used."""
        try:
            rewrite = self.rewriter.rewrite(prompt)
        except NotRewritten as error:
            log.warning("a prompt was not rewritten: %s", error.message)
            return Rewrite(prompt, refused=error.message)
        if rewrite.text == prompt:
            return rewrite
        from marey.text.spelling import Speller

        if self._speller is None:
            self._speller = Speller.load()
        before, after = self._graphs([self._speller.correct(prompt), rewrite.text])
        reason = self._changed(before, after)
        if reason is None:
            return rewrite
        log.info("a rewrite was refused")
        return Rewrite(prompt, refused=reason)

    def _changed(self, before: SemanticGraph, after: SemanticGraph) -> str | None:
        """Describe a change of meaning that the rewriter may not make; None if there is none."""
        if self.spec.wording == "description":
            return lost_meaning(before, after)
        if self.spec.rewriter == "tca":
            return changed_but_aligned(before, after)
        return changed_meaning(before, after)

    def features(self, prompts: Sequence[str]) -> list[TextFeatures]:
        """Graph and node vectors of each prompt.

        Raises:
            InvalidInput: a prompt cannot be used (`check_prompt`).
        """
        checked = [check_prompt(prompt, stored=True) for prompt in prompts]
        made: list[TextFeatures] = []
        for low in range(0, len(checked), TOGETHER):
            made += self._features_of(checked[low : low + TOGETHER])
        return made

    def _features_of(self, prompts: Sequence[str]) -> list[TextFeatures]:
        """Return the features of checked prompts, which are encoded together."""
        rewritten = self._rewritten(prompts)
        readings = self._readings([each.text for each in rewritten])
        read = self._read(readings)
        left_out = self._left_out([each.text for each in rewritten])
        graphs = [self._graphs([each.worded for each in reading.movements]) for reading in readings]
        self._encode_together([*(graph for graph, _ in read), *chain(*graphs)], [actions for _, actions in read])
        return [
            replace(
                self._features(prompt, graph, actions),
                not_rewritten=rewrite.refused,
                seconds=rewrite.seconds,
                left_out=parts,
                movements=self._movements(reading.movements, movements),
            )
            for prompt, rewrite, reading, parts, (graph, actions), movements in zip(
                prompts, rewritten, readings, left_out, read, graphs, strict=True
            )
        ]

    def _encode_together(self, graphs: Sequence[SemanticGraph], actions: Sequence[Sequence[str]]) -> None:
        """Encode the nodes of several graphs, and the actions of prompts with several, in a few passes, in a quarter of
        the time; `_features` finds them."""
        if len(graphs) > 1:
            nodes = [node.text for graph in graphs for node in graph.nodes if self.spec.node_features == "pooled"]
            self.pooled([*nodes, *(text for texts in actions if len(texts) > 1 for text in texts)])

    def _movements(
        self, movements: Sequence[ReadMovement], graphs: Sequence[SemanticGraph]
    ) -> tuple[TextFeatures, ...]:
        """Return the features of each movement of a sequence, which is one action, with its graph."""
        return tuple(
            replace(self._features(each.text, graph, (graph.text,)), seconds=each.seconds)
            for each, graph in zip(movements, graphs, strict=True)
        )

    def _readings(self, texts: Sequence[str]) -> list[ReadPrompt]:
        """Return what each text asks for, as far as `TextSpec.plain_action` and `TextSpec.movements` say."""
        return self._kept_readings.get(texts, self._find_readings)

    def _find_readings(self, texts: Sequence[str]) -> list[ReadPrompt]:
        if not self.spec.plain_action:
            return [ReadPrompt(text) for text in texts]
        texts = [_in_known_words(text) for text in texts]
        encoded, ordered = self._texts_to_read, self._texts_to_order
        if encoded is None or ordered is None:
            return [ReadPrompt.of(text, only_action(text)) for text in texts]
        return self._readers(encoded, ordered).read(texts)

    def _readers(self, encoded: EncodedTexts, ordered: EncodedTexts) -> TrainedReaders:
        return TrainedReaders(encoded.pooled, encoded.encodings, ordered.encodings, movements=self.spec.movements)

    def left_out(self, prompts: Sequence[str]) -> list[tuple[str, ...]]:
        """Return the parts of each prompt that ask for a movement, and that nothing of its reading covers; none where
        prompts are read by their words alone.

        Raises:
            InvalidInput: a prompt cannot be used (`check_prompt`).
        """
        rewritten = self._rewritten([check_prompt(prompt, stored=True) for prompt in prompts])
        return self._left_out([each.text for each in rewritten])

    def _left_out(self, texts: Sequence[str]) -> list[tuple[str, ...]]:
        return self._kept_parts.get(texts, self._find_left_out)

    def _find_left_out(self, texts: Sequence[str]) -> list[tuple[str, ...]]:
        encoded, ordered = self._texts_to_read, self._texts_to_order
        if encoded is None or ordered is None or self.spec.labeller == NO_LABELLER:
            return [()] * len(texts)
        known = [_in_known_words(text) for text in texts]
        several = [text for text in known if may_leave_out(text)]
        frames = dict(zip(several, self._frames(several), strict=True))
        clause = self._readers(encoded, ordered).clause
        return [
            parts_left_out(text, frames[text], reading, clause) if text in frames else ()
            for text, reading in zip(known, self._readings(texts), strict=True)
        ]

    def _encoded_for_readers(self) -> tuple[EncodedTexts, EncodedTexts] | tuple[None, None]:
        """Return the texts as the readers read them, and as that of the order of time does; None if prompts are read by
        their words alone, as with encoders that the readers were not trained for."""
        if not self.spec.plain_action or action_reader().encoder_sha256 != self.encoder.sha256:
            return None, None
        from marey.text.minilm_encoder import MiniLMEncoder

        if not isinstance(self.encoder, MiniLMEncoder):
            return None, None
        return EncodedTexts(reading_encoder(self.encoder)), EncodedTexts(reading_encoder(self.encoder, ORDER_FILE))

    def _read(self, readings: Sequence[ReadPrompt]) -> list[tuple[SemanticGraph, tuple[str, ...]]]:
        """Graph and actions of each text; with `TextSpec.in_order`, the graph of its actions joined in order of
        time.

        A text that would say its one action twice, such as "a person dies, falls down and dies", is not split.
        """
        graphs = self._graphs([reading.worded for reading in readings])
        actions = [split_actions(graph) for graph in graphs]
        for k, reading in enumerate(readings):
            if reading.plain and join_in_order(actions[k]).lower().count(reading.plain) > 1:
                actions[k] = (graphs[k].text,)
        if self.spec.in_order:
            several = [k for k, found in enumerate(actions) if len(found) > 1]
            for k, graph in zip(several, self._graphs([join_in_order(actions[k]) for k in several]), strict=True):
                graphs[k] = graph
        return list(zip(graphs, actions, strict=True))

    def _features(self, prompt: str, graph: SemanticGraph, actions: tuple[str, ...]) -> TextFeatures:
        if len(actions) == 1:
            return TextFeatures(prompt, graph.text, graph, self.encode(graph))
        rows = np.stack(self.pooled(actions)).astype(np.float16)
        return TextFeatures(prompt, graph.text, graph, self.encode(graph), actions=actions, action_rows=rows)

    def encode(self, graph: SemanticGraph) -> NDArray[np.float16]:
        """Return one vector per node, (N, W): the pooled encoding of its own text, or the mean of the sentence's token
        states over its words (`TextSpec.node_features`; the latter as in GraphMotion). Row 0 is always the pooled
        sentence.
        """
        if self.spec.node_features == "pooled":
            rows = self.pooled([node.text for node in graph.nodes])
        else:
            sentence = self._texts.encode(without_punctuation(graph.text))
            starts = _word_starts(graph)
            rows = [self._span(sentence, graph, starts, node) for node in graph.nodes]
        return np.stack(rows).astype(np.float16)

    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """Return the sentence vectors (W,) of texts without the punctuation at their ends."""
        return self._texts.pooled(texts)

    def _graphs(self, texts: Sequence[str]) -> list[SemanticGraph]:
        frames = self._frames(texts)
        caps = {"max_actions": self.spec.max_actions, "max_specifics": self.spec.max_specifics}
        return [build_graph(text, found, **caps) for text, found in zip(texts, frames, strict=True)]

    def _frames(self, texts: Sequence[str]) -> list[tuple[Frame, ...]]:
        return self._kept_frames.get(texts, lambda missing: self.labeller.label([text.split() for text in missing]))

    def _span(self, sentence: Encoding, graph: SemanticGraph, starts: list[int], node: Node) -> NDArray[np.float32]:
        if node.level == "motion":
            return sentence.pooled
        last = node.words[-1]
        span = sentence.span(starts[node.words[0]], starts[last] + len(graph.words[last]))
        return self.pooled([node.text])[0] if span is None else span  # past the encoder's limit: its own text


def _word_starts(graph: SemanticGraph) -> list[int]:
    """Offset of each word in the stripped sentence (words are one space apart: `check_prompt`)."""
    offset = -(len(graph.text) - len(graph.text.lstrip(EDGE_PUNCTUATION)))
    starts: list[int] = []
    for word in graph.words:
        starts.append(offset)
        offset += len(word) + 1
    return starts


def refuse_mismatch(what: str, name: str, sha256: str | None, found_name: str, found_sha256: str) -> None:
    """Raise InvalidBundle if an encoder or labeller differs from the one that a bundle names; `none` hashes match
    any."""
    if name != found_name:
        raise InvalidBundle(f"the text {what} {name!r} is wanted, but {found_name!r} was loaded")
    if sha256 is not None and sha256 != found_sha256:
        raise InvalidBundle(
            f"the model was trained with {what} {name!r} of sha256 {sha256[:12]}, but this machine has "
            f"{found_sha256[:12]}",
            hint="Other weights give other features and a motion that ignores the prompt: install the same ones.",
        )
