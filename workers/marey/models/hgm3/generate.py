"""HGM³'s inference behind one class: features of prompts to features of motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.bundles.body import layout_of
from marey.core.errors import InvalidInput
from marey.generation.groups import MAX_ROWS, RowWatcher, StepCounter, group_rows
from marey.generation.kept import write_kept
from marey.generation.port import GenerationControl, Limits, NoControl, Request, open_bundle, read_settings
from marey.models.hgm3.bundle import Networks, load_networks
from marey.models.hgm3.conditions import graph_batch
from marey.models.hgm3.config import HGM3Config, InferenceConfig
from marey.models.hgm3.decoding import LENGTH_STREAM, DecodeOptions, Items, decode_base, decode_residual
from marey.models.hgm3.model import MaskedTransformer, SeparateTransformers
from marey.motion.features import FeatureLayout
from marey.nn.batch_threads import BatchThreads
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import draw_class

BUCKET = 8
"""Tokens; an item is padded to a multiple of this, not to the longest of its batch."""


@dataclass(frozen=True)
class SamplingSettings:
    """Sampling settings, uniform over a batch; None = the bundle's value."""

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
        names = [n for n in InferenceConfig.__dataclass_fields__ if getattr(self, n, None) is not None]
        config = replace(default, **{n: getattr(self, n) for n in names})
        if config.steps != default.steps:
            share = config.steps / default.steps
            config = replace(
                config,
                motion_steps=round(config.motion_steps * share) if self.motion_steps is None else config.motion_steps,
                action_steps=round(config.action_steps * share) if self.action_steps is None else config.action_steps,
            )
        if not 1 <= config.steps <= 100:
            raise InvalidInput("must lie between 1 and 100", where="steps")
        for name in ("top_k", "residual_top_k"):
            if not 0 < getattr(config, name) <= 1:
                raise InvalidInput("must lie in (0, 1]: the share of codes that may be drawn", where=name)
        for name in ("temperature", "residual_temperature", "guidance", "residual_guidance"):
            if not 0 <= getattr(config, name) <= 100:
                raise InvalidInput("must lie between 0 and 100", where=name)
        return config


@dataclass(frozen=True)
class Generated:
    """One motion as the network generated it, before decoding to joints and clean-up."""

    tokens: NDArray[np.int16]  # (V, n)
    features: NDArray[np.float32]  # (Tf, D), in the layout's own units
    decided: tuple[int, int, int]  # base tokens decided under C^m, [C^m; C^a], [C^m; C^a; C^s]


class Generator:
    """A loaded bundle. Not thread-safe; one per process."""

    def __init__(
        self,
        bundle: Bundle,
        config: HGM3Config,
        networks: Networks,
        device: torch.device,
        dtype: torch.dtype,
        batch_threads: BatchThreads,
    ) -> None:
        self.bundle = bundle
        self.batch_threads = batch_threads
        self.config = config
        self.networks = networks
        self.tokenizer = networks.tokenizer
        self.base: MaskedTransformer | SeparateTransformers = networks.masked
        self.device = device
        self.dtype = dtype
        self.layout: FeatureLayout = layout_of(bundle.manifest)
        self.limits = Limits(
            config.min_frames,
            config.max_frames,
            config.fps,
            config.condition.text_width,
            keeps=config.tokenizer.frames_per_token,
        )
        self.batch = MAX_ROWS

    @classmethod
    def load(
        cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: torch.dtype | None = None
    ) -> Generator:
        """Load a bundle.

        Args:
            bundle: a verified bundle, or its name or path.
            threads: of torch; 0 = torch's default.
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
        results: list[Generated | None] = [None] * len(requests)
        groups = group_rows([self._bucket(count) for count in frames], self.batch_threads.count)
        steps = StepCounter(control or NoControl(), len(groups) * (inference.steps + self.config.tokenizer.levels))

        def make(rows: list[int]) -> None:
            self._group(RowWatcher(steps, rows), requests, frames, inference, options, results)

        with self.batch_threads.open():
            self.batch_threads.map(make, groups)
        return results

    def settings(self, values: Mapping[str, Any]) -> SamplingSettings:
        """Check an item's settings. Raises InvalidInput."""
        settings = read_settings(SamplingSettings, values, InferenceConfig.__dataclass_fields__)
        settings.inference(self.config.inference)
        return settings

    def describe_settings(self, settings: SamplingSettings) -> dict[str, Any]:
        """Return all settings that decide how tokens are drawn."""
        return asdict(settings.inference(self.config.inference))

    def resolve_length(self, request: Request) -> Request:
        """Return the request with a length; the estimator draws a missing one with the request's seed."""
        return replace(request, frames=self.frames(request))

    def frames(self, request: Request) -> int:
        """Return the feature frames: as requested, or drawn by the length estimator. Raises InvalidInput if out of
        range."""
        self.limits.check(request)
        return self._estimate(request) if request.frames is None else request.frames

    def bucket(self, request: Request) -> int:
        """Return the tokens rounded up to the bucket; items of one bucket share a forward pass."""
        return self._bucket(self.frames(request))

    def _bucket(self, frames: int) -> int:
        tokens = -(-frames // self.frames_per_token)
        return -(-tokens // BUCKET) * BUCKET

    def _estimate(self, request: Request) -> int:
        """Draw frames from the middle third of the estimated distribution (ours): seeds differ, without extremes."""
        sentence = torch.from_numpy(request.text.nodes[:1].astype(np.float32)).to(self.device)
        tokens = draw_class(self.networks.length(sentence), request.seed, LENGTH_STREAM, middle=True) + 1
        frames = tokens * self.frames_per_token
        return min(max(frames, self.config.min_frames), self.config.max_frames)

    def _group(
        self,
        watcher: RowWatcher,
        requests: Sequence[Request],
        frames: Sequence[int],
        inference: InferenceConfig,
        options: DecodeOptions,
        results: list[Generated | None],
    ) -> None:
        rows = watcher.rows
        if not rows:
            return
        items = self._items([requests[r] for r in rows], [frames[r] for r in rows])
        items = decode_base(self.base, items, inference, options, watcher.step)
        items = decode_residual(self.networks.residual, items, inference, options, watcher.step)
        if not watcher.rows:
            return
        for position, row in enumerate(watcher.rows):
            # one by one, at its own length: a convolution rounds differently in another batch, and files would differ
            tokens = items.tokens[position, : int(items.lengths[position])]  # (n, V)
            features = self.networks.tokenizer.decode(tokens[None])[0, : frames[row]]
            results[row] = Generated(
                tokens.T.cpu().numpy().astype(np.int16),
                features.cpu().numpy(),
                tuple(items.decided[position].tolist()),
            )
        watcher.step()

    def _items(self, requests: Sequence[Request], frames: Sequence[int]) -> Items:
        lengths = [-(-f // self.frames_per_token) for f in frames]
        bucket = -(-max(lengths) // BUCKET) * BUCKET
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
