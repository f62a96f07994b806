"""Model card of a TMR-style evaluator, generated from the manifest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from marey.bundles import TextSpec
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.reference import RealClips

TEXT = """# {name}: motions and captions in one space, to evaluate text-to-motion models

TMR (Petrovich et al. 2023) as sized in the appendix B.2 of SnapMoGen (2025), Marey's `{config}`: a
motion encoder and a text encoder of {layers} layers, width {width}, {heads} heads, feed-forward {feedforward}. Mean
vectors are the embeddings, their cosine is the score. The bundle does not contain the decoder that
training needed. It reads {layout} at {fps:g} fps, {least} to {most} frames, the first {inputs} numbers of a
frame, normalised with this bundle's own statistics, {frames} frames a token; sentences as token states
of `{encoder}` (width {width_text}, sha256 {sha256}).

## Terms

**{licence}**, as the data it was trained on:

{sources}

The captions in `reference.json` are free (MIT): sentences of Marey's own grammar, and for CMU's
trials sentences made of their short public descriptions.

## Retrieval

{metrics}

`pair_r1` to `pair_r3`: R-precision in pools of 32 test clips, text to motion, where the pair alone is a
hit; `label`: where a motion of the text's own label is one; `distinct`: in pools where no label occurs
twice. Median ranks are among all test
clips, where only the pair is a hit, text to motion and back. Captions and pools are drawn 20 times.
A label is actions, sides and style (`workers/marey/evaluator/labels.py`).

## Reference

{reference}

Each clip has captions, label, length, the embedding of its motion, the verdict of the prompt
checker, foot skate, jerk, bone drift and floor penetration. A server without the data can therefore
evaluate. The bundle holds no joints and no features of captured motion.

## Limits

- Captions are of one grammar, on few actions, in English. It cannot judge actions that the data do
  not show.
- About one caption in seven of clips with one action leaves the style out; a motion of another
  style then counts as a wrong answer.
- Its numbers are comparable with numbers of exactly this bundle, never with those of papers.
"""


def card_of(
    name: str, config: EvaluatorConfig, text: TextSpec, manifest: Mapping[str, Any], reference: RealClips
) -> str:
    """Generate the card.

    Args:
        name: name of the bundle.
        config: configuration of the networks.
        text: the encoder, with its hash.
        manifest: licence, data and metrics, as the bundle's manifest has them.
        reference: the bundle's real clips.
    """
    network = config.network
    test = {key.rpartition("/")[2]: value for key, value in manifest["metrics"].items() if "/test/" in key}
    rows = [f"| {key} | {value:.1f} |" if "rank" in key else f"| {key} | {value:.3f} |" for key, value in test.items()]
    splits = [f"- `{key}`: {len(split.clips)} clips" for key, split in reference.splits.items()]
    return TEXT.format(
        name=name,
        config=config.name,
        layers=network.layers,
        width=network.width,
        heads=network.heads,
        feedforward=network.feedforward,
        layout=config.layout,
        fps=config.fps,
        least=config.min_frames,
        most=config.max_frames,
        inputs=config.inputs,
        frames=config.frames_per_token,
        encoder=text.encoder,
        width_text=text.width,
        sha256=(text.encoder_sha256 or "")[:12],
        licence=manifest["licence"],
        sources="\n".join(f"- {source.credit} ({source.licence})" for source in manifest["data"]),
        metrics="\n".join(["| test split | |", "|---|---|", *rows]) if rows else "Not measured: too few test clips.",
        reference="\n".join(splits) or "None: the data had no such clips.",
    )
