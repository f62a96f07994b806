"""HGM³'s inference behind one class: features of prompts to features of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.generation.base import GroupedGenerator, Sampling
from marey.generation.groups import RowWatcher
from marey.generation.kept import write_kept
from marey.generation.port import GenerationControl, Limits, Request, open_bundle
from marey.models.hgm3.bundle import Networks, load_networks
from marey.models.hgm3.conditions import graph_batch
from marey.models.hgm3.config import HGM3Config, InferenceConfig
from marey.models.hgm3.decoding import LENGTH_STREAM, DecodeOptions, Items, decode_base, decode_residual
from marey.models.hgm3.model import MaskedTransformer, SeparateTransformers
from marey.models.hgm3.spec import SPEC
from marey.nn.batch_threads import BatchThreads
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import draw_class

BUCKET = 8
"""Tokens; an item is padded to a multiple of this, not to the longest of its batch."""


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
    min_progress: bool = False
    skip_idle: bool = True
    trim_slots: bool = True

    def inference(self, default: InferenceConfig) -> InferenceConfig:
        """Return the bundle's decoding settings with this batch's changes; stage boundaries scale with the steps.

        Raises:
            InvalidInput: a value out of range.
        """
        config = super().inference(default)
        if config.steps == default.steps:
            return config
        share = config.steps / default.steps
        return replace(
            config,
            motion_steps=round(config.motion_steps * share) if self.motion_steps is None else config.motion_steps,
            action_steps=round(config.action_steps * share) if self.action_steps is None else config.action_steps,
        )


@dataclass(frozen=True)
class Generated:
    """One motion as the network generated it, before decoding to joints and clean-up."""

    tokens: NDArray[np.int16]  # (V, n)
    features: NDArray[np.float32]  # (Tf, D), in the layout's own units
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
        super().__init__(bundle, limits, config.inference, device, dtype, batch_threads)
        self.config = config
        self.networks = networks
        self.tokenizer = networks.tokenizer
        self.base: MaskedTransformer | SeparateTransformers = networks.masked

    @classmethod
    def load(
        cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: torch.dtype | None = None
    ) -> Generator:
        """Load a bundle.

        Args:
            bundle: a verified bundle, or its name or path.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            threads: of torch; 0 leaves torch's own choice.
            dtype: of the transformers' matrices; None = bfloat16 where the device multiplies it fast, else float32.

        Raises:
            InvalidBundle: not HGM³, or damaged.
            InvalidInput: unknown device.
        """
        verified, chosen, dtype = open_bundle(bundle, device, threads, dtype)
        config, networks = load_networks(verified)
        for part in networks.parts().values():
            part.to(chosen)
        # float32, too: on a CPU its matrices are packed. The encoder stays as in training: its tokens must not change.
        batch_threads = BatchThreads(torch.get_num_threads() if chosen.type == "cpu" else 1)
        networks.masked.prepare_inference(dtype, batch_threads)
        networks.residual.prepare_inference(dtype, batch_threads)
        if dtype != torch.float32:
            networks.tokenizer.decoder.prepare_inference(dtype)
        return cls(verified, config, networks, chosen, dtype, batch_threads)

    @property
    def frames_per_token(self) -> int:
        """Return N/n, the frames of a token."""
        return self.config.tokenizer.frames_per_token

    @torch.inference_mode()
    def generate(
        self,
        requests: Sequence[Request],
        settings: SamplingSettings | None = None,
        *,
        control: GenerationControl | None = None,
    ) -> list[Generated | None]:
        """Generate one motion per request; None where `control` dropped it.

        The tokens of an item do not depend on the number or order of the others.

        Raises:
            InvalidInput: a length or seed out of range, or features of another encoder.
        """
        settings = settings or SamplingSettings()
        inference = settings.inference(self.config.inference)
        options = DecodeOptions(settings.skip_idle, settings.trim_slots, settings.min_progress)
        frames = [self.frames(request) for request in requests]

        def draw(watcher: RowWatcher) -> list[Generated]:
            return self._group(watcher, requests, frames, inference, options)

        return self._in_groups(frames, inference.steps + self.config.tokenizer.levels, control, draw)

    def _bucket(self, frames: int) -> int:
        return -(-self._tokens(frames) // BUCKET) * BUCKET

    def _estimate(self, request: Request) -> int:
        """Draw frames from the middle third of the estimated distribution (ours): seeds differ, without extremes."""
        sentence = torch.from_numpy(request.text.nodes[:1].astype(np.float32)).to(self.device)
        tokens = draw_class(self.networks.length(sentence), request.seed, LENGTH_STREAM, middle=True) + 1
        return self.limits.within(tokens * self.frames_per_token)

    def _group(
        self,
        watcher: RowWatcher,
        requests: Sequence[Request],
        frames: Sequence[int],
        inference: InferenceConfig,
        options: DecodeOptions,
    ) -> list[Generated]:
        rows = watcher.rows
        items = self._items([requests[r] for r in rows], [frames[r] for r in rows])
        items = decode_base(self.base, items, inference, options, watcher.step)
        items = decode_residual(self.networks.residual, items, inference, options, watcher.step)
        return [self._generated(items, position, frames[row]) for position, row in enumerate(watcher.rows)]

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
            write_kept(tokens[row], request, self.networks.tokenizer)
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
