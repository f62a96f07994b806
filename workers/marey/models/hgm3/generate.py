"""HGM³'s inference behind one class: features of prompts to features of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import torch

from marey.bundles import Bundle
from marey.generation.base import Draw, GeneratedMotion, GroupedGenerator, Sampling
from marey.generation.groups import RowWatcher
from marey.generation.kept import write_kept
from marey.generation.port import Limits, Request
from marey.models.hgm3.bundle import Networks, load_networks
from marey.models.hgm3.conditions import graph_batch
from marey.models.hgm3.config import HGM3Config, InferenceConfig
from marey.models.hgm3.decoding import LENGTH_STREAM, DecodeOptions, Items, decode_base, decode_residual
from marey.models.hgm3.model import MaskedTransformer, SeparateTransformers
from marey.models.hgm3.spec import SPEC
from marey.nn.batch_threads import BatchThreads
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import draw_class


@dataclass(frozen=True)
class SamplingSettings(Sampling[InferenceConfig]):
    """Sampling settings, uniform over a batch; None = the bundle's value."""

    spec = SPEC

    steps: int | None = None
    motion_steps: int | None = None
    action_steps: int | None = None
    guidance: float | None = None
    temperature: float | None = None
    top_k: float | None = None
    residual_guidance: float | None = None
    residual_temperature: float | None = None
    residual_top_k: float | None = None
    drawing: int | None = None
    min_progress: bool = False
    skip_idle: bool = True
    trim_slots: bool = True

    def inference(self, default: InferenceConfig) -> InferenceConfig:
        """Return the bundle's decoding settings with this batch's changes; stage boundaries scale with the steps.

        Raises:
            InvalidInput: a value out of range, or a boundary behind the next.
        """
        config = super().inference(default)
        if config.steps != default.steps:
            share = config.steps / default.steps
            config = replace(
                config,
                motion_steps=round(config.motion_steps * share) if self.motion_steps is None else config.motion_steps,
                action_steps=round(config.action_steps * share) if self.action_steps is None else config.action_steps,
            )
        config.check()
        return config


@dataclass(frozen=True)
class Generated(GeneratedMotion):
    """One motion as the network generated it."""

    decided: tuple[int, int, int]  # base tokens decided under C^m, [C^m; C^a], [C^m; C^a; C^s]


class Generator(GroupedGenerator[SamplingSettings, Generated]):
    """A loaded bundle. Not thread-safe; one per process."""

    sampling = SamplingSettings

    def __init__(
        self,
        bundle: Bundle,
        config: HGM3Config,
        networks: Networks,
        device: torch.device,
        dtype: torch.dtype,
        batch_threads: BatchThreads,
    ) -> None:
        limits = Limits(
            config.min_frames,
            config.max_frames,
            config.fps,
            config.condition.text_width,
            keeps=config.tokenizer.frames_per_token,
        )
        super().__init__(bundle, limits, config.inference, networks.tokenizer, device, dtype, batch_threads)
        self.config = config
        self.networks = networks
        self.base: MaskedTransformer | SeparateTransformers = networks.masked

    @classmethod
    def _of(cls, bundle: Bundle, device: torch.device, dtype: torch.dtype) -> Self:
        config, networks = load_networks(bundle)
        networks.to(device)
        batch_threads = BatchThreads.on(device)
        # float32, too: on a CPU its matrices are packed. The encoder stays as in training: its tokens must not change.
        networks.masked.prepare_inference(dtype, batch_threads)
        networks.residual.prepare_inference(dtype, batch_threads)
        if dtype != torch.float32:
            networks.tokenizer.decoder.prepare_inference(dtype)
        return cls(bundle, config, networks, device, dtype, batch_threads)

    def _estimate(self, request: Request) -> int:
        """Draw frames from the middle third of the estimated distribution (ours): seeds differ, without extremes."""
        logits = self.networks.length(self._sentence(request))
        tokens = draw_class(logits, request.seed, LENGTH_STREAM, middle=True) + 1
        return self.limits.within(tokens * self.frames_per_token)

    def _drawing(
        self, requests: Sequence[Request], frames: Sequence[int], settings: SamplingSettings
    ) -> tuple[int, Draw[Generated]]:
        inference = settings.inference(self.config.inference)
        options = DecodeOptions(settings.skip_idle, settings.trim_slots, settings.min_progress)

        def draw(watcher: RowWatcher) -> list[Generated]:
            rows = watcher.rows
            items = self._items([requests[r] for r in rows], [frames[r] for r in rows])
            items = decode_base(self.base, items, inference, options, watcher.step)
            items = decode_residual(self.networks.residual, items, inference, options, watcher.step)
            return [self._generated(items, position, frames[row]) for position, row in enumerate(watcher.rows)]

        return inference.steps + self.config.tokenizer.levels, draw

    def _generated(self, items: Items, position: int, frames: int) -> Generated:
        """Decode one item alone, at its own length: a convolution rounds differently in another batch, and files would
        differ."""
        tokens = items.tokens[position, : int(items.lengths[position])]  # (n, V)
        features = self.networks.tokenizer.decode(tokens[None])[0, :frames]
        decided = tuple(items.decided[position].tolist())
        return Generated(tokens.T.cpu().numpy().astype(np.int16), features.cpu().numpy(), decided)

    def _items(self, requests: Sequence[Request], frames: Sequence[int]) -> Items:
        lengths, bucket = [self._tokens(count) for count in frames], self._bucket(max(frames))
        device, levels = self.device, self.config.tokenizer.levels
        # One by one, once a batch: a float32 product of few rows rounds differently with their number.
        graphs = [graph_batch([r.text], self.config.condition, device) for r in requests]
        base, residual = self.base, self.networks.residual
        tokens = torch.full((len(requests), bucket, levels), NO_TOKEN, device=device)
        for row, request in enumerate(requests):
            write_kept(tokens[row], request, self.tokenizer)
        return Items(
            lengths=torch.tensor(lengths, device=device),
            seeds=torch.tensor([r.seed for r in requests], device=device),
            condition=torch.cat([base.read(graph) for graph in graphs]),
            present=torch.cat([graph.present for graph in graphs]),
            sentence=torch.cat([residual.sentence(graph.nodes[:, 0]) for graph in graphs]),
            free=torch.tensor([r.free for r in requests], device=device),
            tokens=tokens,
            kept=tokens[..., 0] != NO_TOKEN,
            decided=torch.zeros(len(requests), 3, dtype=torch.long, device=device),
        )
