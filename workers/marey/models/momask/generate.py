"""MoMask's inference behind one class: features of prompts to features of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch

from marey.bundles import Bundle
from marey.generation.base import Draw, GeneratedMotion, GroupedGenerator, Sampling
from marey.generation.groups import RowWatcher
from marey.generation.port import Limits, Request
from marey.models.momask.bundle import Networks, load_networks
from marey.models.momask.config import InferenceConfig, MoMaskConfig
from marey.models.momask.decoding import LENGTH_STREAM, Items, decode_base, decode_residual
from marey.models.momask.spec import SPEC
from marey.nn.batch_threads import BatchThreads
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import draw_class


@dataclass(frozen=True)
class SamplingSettings(Sampling[InferenceConfig]):
    """Sampling settings, uniform over a batch; None = the bundle's value."""

    spec = SPEC

    steps: int | None = None
    guidance: float | None = None
    temperature: float | None = None
    top_k: float | None = None
    residual_guidance: float | None = None
    residual_temperature: float | None = None
    residual_top_k: float | None = None


class Generator(GroupedGenerator[SamplingSettings, GeneratedMotion]):
    """A loaded bundle. Not thread-safe; one per process."""

    sampling = SamplingSettings

    def __init__(
        self,
        bundle: Bundle,
        config: MoMaskConfig,
        networks: Networks,
        device: torch.device,
        dtype: torch.dtype,
        batch_threads: BatchThreads,
    ) -> None:
        limits = Limits(config.min_frames, config.max_frames, config.fps, config.text_width)
        super().__init__(bundle, limits, config.inference, networks.tokenizer, device, dtype, batch_threads)
        self.config = config
        self.networks = networks

    @classmethod
    def _of(cls, bundle: Bundle, device: torch.device, dtype: torch.dtype) -> Self:
        config, networks = load_networks(bundle)
        networks.to(device)
        batch_threads = BatchThreads.on(device)
        # float32, too: on a CPU its matrices are packed. The encoder stays as it is: its tokens must not change.
        networks.masked.prepare_inference(dtype, batch_threads)
        networks.residual.prepare_inference(dtype, batch_threads)
        if dtype != torch.float32:
            networks.tokenizer.decoder.prepare_inference(dtype)
        return cls(bundle, config, networks, device, dtype, batch_threads)

    def _estimate(self, request: Request) -> int:
        """Draw frames from the estimated distribution, as the public code does, and keep them within the limits."""
        tokens = draw_class(self.networks.length(self._sentence(request)), request.seed, LENGTH_STREAM)
        return self.limits.within(tokens * self.frames_per_token)

    def _drawing(
        self, requests: Sequence[Request], frames: Sequence[int], settings: SamplingSettings
    ) -> tuple[int, Draw[GeneratedMotion]]:
        inference = settings.inference(self.config.inference)

        def draw(watcher: RowWatcher) -> list[GeneratedMotion]:
            rows = watcher.rows
            items = self._items([requests[r] for r in rows], [frames[r] for r in rows])
            items = decode_base(self.networks.masked, items, inference, watcher.step)
            items = decode_residual(self.networks.residual, items, inference, watcher.step)
            return [self._generated(items, position, frames[row]) for position, row in enumerate(watcher.rows)]

        return inference.steps + self.config.tokenizer.levels, draw

    def _generated(self, items: Items, position: int, frames: int) -> GeneratedMotion:
        """Decode one item alone, at its own length: padding would change the motion's end (`Tokenizer`).

        A drawn padding token is -1 and adds nothing.
        """
        tokens = items.tokens[position, : int(items.lengths[position])]  # (n, V)
        features = self.networks.tokenizer.decode(tokens[None])[0, :frames]
        return GeneratedMotion(tokens.T.cpu().numpy().astype(np.int16), features.cpu().numpy())

    def _items(self, requests: Sequence[Request], frames: Sequence[int]) -> Items:
        lengths = [self._tokens(count) for count in frames]
        device, bucket = self.device, self._bucket(max(frames))
        masked, residual = self.networks.masked, self.networks.residual
        # One by one: a product of few rows rounds differently with their number.
        sentences = [self._sentence(request) for request in requests]
        return Items(
            lengths=torch.tensor(lengths, device=device),
            seeds=torch.tensor([r.seed for r in requests], device=device),
            masked_sentence=torch.cat([masked.condition(each) for each in sentences]),
            residual_sentence=torch.cat([residual.condition(each) for each in sentences]),
            tokens=torch.full((len(requests), bucket, self.config.tokenizer.levels), NO_TOKEN, device=device),
        )
