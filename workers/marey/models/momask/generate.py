"""MoMask's inference behind one class: features of prompts to features of motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle
from marey.bundles.body import layout_of
from marey.generation.groups import MAX_ROWS, RowWatcher, StepCounter, group_rows
from marey.generation.port import GenerationControl, Limits, NoControl, Request, open_bundle, read_settings
from marey.models.momask.bundle import Networks, load_networks
from marey.models.momask.config import InferenceConfig, MoMaskConfig
from marey.models.momask.decoding import LENGTH_STREAM, Items, decode_base, decode_residual
from marey.models.momask.spec import SPEC
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
    guidance: float | None = None
    temperature: float | None = None
    top_k: float | None = None
    residual_guidance: float | None = None
    residual_temperature: float | None = None
    residual_top_k: float | None = None

    def inference(self, default: InferenceConfig) -> InferenceConfig:
        """Return the bundle's decoding settings with this batch's changes.

        Raises:
            InvalidInput: a value out of range.
        """
        changes = {name: value for name, value in asdict(self).items() if value is not None}
        config = replace(default, **changes)
        for setting in SPEC.settings:
            setting.check(getattr(config, setting.name))
        return config


@dataclass(frozen=True)
class Generated:
    """One motion as the network generated it, before decoding to joints and clean-up."""

    tokens: NDArray[np.int16]  # (V, n); -1 = a drawn padding token, which adds nothing
    features: NDArray[np.float32]  # (Tf, D), in the layout's own units


class Generator:
    """A loaded bundle. Not thread-safe; one per process."""

    def __init__(
        self,
        bundle: Bundle,
        config: MoMaskConfig,
        networks: Networks,
        device: torch.device,
        dtype: torch.dtype,
        batch_threads: BatchThreads,
    ) -> None:
        self.bundle = bundle
        self.batch_threads = batch_threads
        self.config = config
        self.networks = networks
        self.device = device
        self.dtype = dtype
        self.layout: FeatureLayout = layout_of(bundle.manifest)
        self.limits = Limits(config.min_frames, config.max_frames, config.fps, config.text_width)
        self.batch = MAX_ROWS

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
            InvalidBundle: not MoMask, or damaged.
            InvalidInput: unknown device.
        """
        verified, chosen, dtype = open_bundle(bundle, device, threads, dtype)
        config, networks = load_networks(verified)
        for part in networks.parts().values():
            part.to(chosen)
        # float32, too: on a CPU its matrices are packed. The encoder stays as it is: its tokens must not change.
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
        inference = (settings or SamplingSettings()).inference(self.config.inference)
        frames = [self.frames(request) for request in requests]
        results: list[Generated | None] = [None] * len(requests)
        groups = group_rows([self._bucket(count) for count in frames], self.batch_threads.count)
        steps = StepCounter(control or NoControl(), len(groups) * (inference.steps + self.config.tokenizer.levels))

        def make(rows: list[int]) -> None:
            self._group(RowWatcher(steps, rows), requests, frames, inference, results)

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
        return -(-self._tokens(frames) // BUCKET) * BUCKET

    def _tokens(self, frames: int) -> int:
        return -(-frames // self.frames_per_token)

    @torch.inference_mode()
    def _estimate(self, request: Request) -> int:
        """Draw frames from the estimated distribution, as the public code does, and keep them within the limits."""
        tokens = draw_class(self.networks.length(self._sentence(request)), request.seed, LENGTH_STREAM)
        frames = tokens * self.frames_per_token
        return min(max(frames, self.config.min_frames), self.config.max_frames)

    def _sentence(self, request: Request) -> Tensor:
        """Return the sentence feature (1, W)."""
        return torch.from_numpy(request.text.sentence[None].astype(np.float32)).to(self.device)

    def _group(
        self,
        watcher: RowWatcher,
        requests: Sequence[Request],
        frames: Sequence[int],
        inference: InferenceConfig,
        results: list[Generated | None],
    ) -> None:
        rows = watcher.rows
        if not rows:
            return
        items = self._items([requests[r] for r in rows], [frames[r] for r in rows])
        items = decode_base(self.networks.masked, items, inference, watcher.step)
        items = decode_residual(self.networks.residual, items, inference, watcher.step)
        for position, row in enumerate(watcher.rows):
            # one by one, at its own length: padding would change the motion's end (`Tokenizer`)
            tokens = items.tokens[position, : int(items.lengths[position])]  # (n, V)
            features = self.networks.tokenizer.decode(tokens[None])[0, : frames[row]]
            results[row] = Generated(tokens.T.cpu().numpy().astype(np.int16), features.cpu().numpy())
        if watcher.rows:
            watcher.step()

    def _items(self, requests: Sequence[Request], frames: Sequence[int]) -> Items:
        lengths = [self._tokens(count) for count in frames]
        device, bucket = self.device, max(self._bucket(count) for count in frames)
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
