"""Training stage of the TMR-style evaluator: motions and captions into one space."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.core.errors import InvalidFile, InvalidInput
from marey.data.sampling import author_table, draw_captions, sampling_weights
from marey.evaluator.caption_retrieval import EmbeddedSplit, retrieval_scores
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.labels import label_ids, label_of
from marey.evaluator.losses import divergences, info_nce, latent_distance, reconstruction
from marey.evaluator.model import TMR, Gaussian
from marey.evaluator.sentences import CaptionStates
from marey.nn.convolution import frame_mask
from marey.text.encoders import TextEncoder
from marey.training.motions import MotionData
from marey.training.pairs import pieces_of
from marey.training.stages import StepContext

STATISTICS_CAPTIONS = 1024
"""Number of training captions for the statistics of text features: 19,000 tokens, with a standard error of 1 %."""


@dataclass(frozen=True)
class CaptionedBatch:
    """Clips, each with one of its captions."""

    features: Tensor  # (B, T, I), raw
    lengths: Tensor  # (B,) frames
    states: Tensor  # (B, S, W)
    words: Tensor  # (B,) text tokens
    labels: Tensor  # (B,)


class TMRStage:
    """The loss of App. B.2 on batches of clips, drawn as often as for the generators."""

    name = "tmr"

    def __init__(self, config: EvaluatorConfig, data: MotionData, encoder: TextEncoder) -> None:
        """Build the networks and choose the clips.

        Raises:
            InvalidInput: the data have another layout, or no clip to train on.
            InvalidFile: texts of another encoder's width.
        """
        _check(config, data, encoder)
        self.config = config
        self.optimisation = config.train_tmr
        self.clips = data.prepared.clips
        self.authors = author_table(data.prepared.caption_counts)
        device = data.features.device
        self.data = dataclasses.replace(data, features=data.features[:, : config.inputs].clone())
        self.captions = CaptionStates(encoder, device)
        self.module = TMR(config).to(device)
        self.starts = torch.tensor([c.start for c in self.clips], device=device)
        self.lengths = torch.tensor([min(c.length, config.max_frames) for c in self.clips], device=device)
        self.labels = torch.from_numpy(label_ids([label_of(c) for c in self.clips])).to(device)
        self.train = self.rows("train")
        if not len(self.train):
            raise InvalidInput("holds no clip to train on", where=str(data.prepared.path))
        self.weights = sampling_weights([self.clips[int(i)] for i in self.train])
        self.module.motion.mean.copy_(data.mean)
        self.module.motion.std.copy_(data.std)
        self._set_text_statistics()

    def rows(self, split: str) -> NDArray[np.int64]:
        """Return clips of a split that have captions and are long enough."""
        usable = [
            i
            for i, clip in enumerate(self.clips)
            if clip.split == split and clip.captions and clip.length >= self.config.min_frames
        ]
        return np.array(usable, np.int64)

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of one batch, each clip with a random caption."""
        size = self.optimisation.batch
        clips: NDArray[np.int64] = context.rng.choice(self.train, size=size, p=self.weights)
        chosen = draw_captions(self.authors[clips], context.rng.random(size))
        said = [self.clips[int(i)].captions[k] for i, k in zip(clips, chosen, strict=True)]
        terms = self._terms(self._batch(clips, said))
        return terms["loss"], {name: value.detach() for name, value in terms.items()}

    def after_step(self, context: StepContext) -> None:
        """Do nothing."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return the terms of the loss over validation clips, each with its first caption, and retrieval among them."""
        rows = self.rows("val")
        found: list[dict[str, Tensor]] = []
        for part in _parts(rows, self.optimisation.batch):
            found.append(self._terms(self._batch(part, [self.clips[int(i)].captions[0] for i in part])))
        means = {name: float(np.mean([float(each[name]) for each in found])) for name in (found[0] if found else ())}
        return means | self.retrieval("val")

    @torch.no_grad()
    def retrieval(self, split: str) -> dict[str, float]:
        """See `retrieval_scores`."""
        rows = self.rows(split)
        return retrieval_scores(self.embed(rows), "cosine") if len(rows) else {}

    def test(self) -> dict[str, float]:
        """Return retrieval scores on the test split."""
        return {f"test/{name}": value for name, value in self.retrieval("test").items()}

    @torch.no_grad()
    def embed(self, rows: NDArray[np.int64]) -> EmbeddedSplit:
        """Return embeddings of clips and of all their captions."""
        size = self.optimisation.batch
        motion = [_in_pieces(self.module.motion, *self._motions(part)).mean for part in _parts(rows, size)]
        said = [caption for i in rows for caption in self.clips[int(i)].captions]
        text = [_in_pieces(self.module.text, *self.captions.batch(part)).mean for part in _parts(said, size)]
        counts = np.array([len(self.clips[int(i)].captions) for i in rows], np.int64)
        return EmbeddedSplit(
            torch.cat(motion).float().cpu().numpy(),
            torch.cat(text).float().cpu().numpy(),
            counts,
            self.labels[torch.from_numpy(rows).to(self.labels.device)].cpu().numpy(),
        )

    def _motions(self, clips: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
        chosen = torch.from_numpy(clips).to(self.starts.device)
        lengths = self.lengths[chosen]
        return self.data.windows(self.starts[chosen], int(lengths.max())), lengths

    def _batch(self, clips: NDArray[np.int64], said: Sequence[str]) -> CaptionedBatch:
        labels = self.labels[torch.from_numpy(clips).to(self.labels.device)]
        return CaptionedBatch(*self._motions(clips), *self.captions.batch(said), labels)

    def _terms(self, batch: CaptionedBatch) -> dict[str, Tensor]:
        """Return the loss and its terms (App. B.2); latents are samples in training, means in validation."""
        weights = self.config.loss
        labels = batch.labels if weights.spare_same_label else None
        motion = _in_pieces(self.module.motion, batch.features, batch.lengths)
        text = _in_pieces(self.module.text, batch.states, batch.words)
        terms = {
            "reconstruction": self._reconstruction(batch, (motion, text)),
            "divergence": divergences(motion, text),
            "latent": latent_distance(motion, text),
            "contrast": info_nce(text.mean, motion.mean, labels, weights.temperature),
        }
        loss = terms["reconstruction"] + weights.contrast * terms["contrast"]
        loss = loss + weights.divergence * terms["divergence"] + weights.latent * terms["latent"]
        return {"loss": loss, **terms}

    def _reconstruction(self, batch: CaptionedBatch, latents: Sequence[Gaussian]) -> Tensor:
        """Return L_rec: smooth L1 of the motion decoded from either latent, mean over existing frames, summed."""
        drawn = [each.sample() if self.module.training else each.mean for each in latents]
        target = self.module.motion.normalize(batch.features)
        total = target.new_zeros(())
        for rows in pieces_of(batch.lengths):
            lengths = batch.lengths[rows]
            size = int(lengths.max())
            mask = frame_mask(lengths, size)
            both = self.module.decoder(torch.cat([each[rows] for each in drawn]), lengths.repeat(len(drawn)))
            for predicted in both[:, :size].chunk(len(drawn)):
                total = total + reconstruction(predicted, target[rows, :size], mask)
        return total / (batch.lengths.sum() * self.config.inputs)

    def _set_text_statistics(self) -> None:
        rng = np.random.default_rng(0)
        said = [caption for i in self.train for caption in self.clips[int(i)].captions]
        chosen = rng.choice(len(said), size=min(len(said), STATISTICS_CAPTIONS), replace=False)
        states = torch.cat(self.captions.states([said[int(i)] for i in chosen])).double()
        self.module.text.text_mean.copy_(states.mean(0))
        self.module.text.text_std.copy_(states.std(0).clamp(min=1e-4))


Encode = Callable[[Tensor, Tensor], Gaussian]


def _in_pieces(encode: Encode, x: Tensor, lengths: Tensor) -> Gaussian:
    """Return Gaussians of sequences (B, S, …) of `lengths` (B,), encoded in pieces of similar length."""
    pieces = pieces_of(lengths)
    found = [encode(x[rows, : int(lengths[rows].max())], lengths[rows]) for rows in pieces]
    back = torch.argsort(torch.cat(pieces))
    return Gaussian(
        torch.cat([each.mean for each in found])[back], torch.cat([each.log_variance for each in found])[back]
    )


def _parts(rows: Sequence[str] | NDArray[np.int64], size: int) -> Iterator:
    return (rows[at : at + size] for at in range(0, len(rows), size))


def _check(config: EvaluatorConfig, data: MotionData, encoder: TextEncoder) -> None:
    manifest = data.prepared.manifest
    if (manifest.layout, manifest.fps) != (config.layout, config.fps):
        raise InvalidInput(
            f"holds {manifest.layout} at {manifest.fps:g} fps, this configuration reads {config.layout} at "
            f"{config.fps:g} fps",
            where=str(data.prepared.path),
        )
    if encoder.width != config.text_width:
        raise InvalidFile(
            f"texts have width {encoder.width}; this configuration reads {config.text_width}",
            hint="Run `marey data text` with the encoder of the configuration.",
        )
