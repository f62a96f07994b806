"""MoMask++'s inference behind one class: prompts to features of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle
from marey.generation.base import Draw, GeneratedMotion, GroupedGenerator, Sampling
from marey.generation.groups import RowWatcher
from marey.generation.kept import bridged, whole_tokens
from marey.generation.port import Limits, Request
from marey.models.momaskpp.bundle import ScaleNetworks, load_networks
from marey.models.momaskpp.config import InferenceConfig, MoMaskPPConfig
from marey.models.momaskpp.decoding import LENGTH_STREAM, ScaleItems, decode
from marey.models.momaskpp.model import ROOT_VELOCITY, RootRefiner, inputs_of
from marey.models.momaskpp.spec import SPEC
from marey.models.momaskpp.words import WordReader, pad_states
from marey.nn.batch_threads import BatchThreads
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import draw_class, uniform


@dataclass(frozen=True)
class SamplingSettings(Sampling[InferenceConfig]):
    """Sampling settings, uniform over a batch; None = the bundle's value."""

    spec = SPEC

    steps: int | None = None
    guidance: float | None = None
    temperature: float | None = None
    top_k: float | None = None


class Generator(GroupedGenerator[SamplingSettings, GeneratedMotion]):
    """A loaded bundle. Not thread-safe; one per process."""

    sampling = SamplingSettings

    def __init__(
        self,
        bundle: Bundle,
        config: MoMaskPPConfig,
        networks: ScaleNetworks,
        reader: WordReader,
        device: torch.device,
        dtype: torch.dtype,
        batch_threads: BatchThreads,
    ) -> None:
        limits = Limits(
            config.min_frames, config.max_frames, config.fps, config.text.width, keeps=config.tokenizer.frames_per_token
        )
        super().__init__(bundle, limits, config.inference, networks.tokenizer, device, dtype, batch_threads)
        self.config = config
        self.networks = networks
        self.reader = reader
        self.scales = networks.tokenizer.scales

    @classmethod
    def load(
        cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: torch.dtype | None = None
    ) -> Self:
        """Load a bundle, and the text encoder that it names: words are encoded here (docs/decisions/0026).

        Args:
            bundle: a verified bundle, or its name or path.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            threads: of torch; 0 leaves torch's own choice.
            dtype: of the transformer's matrices; None = bfloat16 where the device multiplies it fast, else float32, in
                which published weights are compared.

        Raises:
            InvalidBundle: of another model, damaged, or made with another text encoder than is installed.
            InvalidInput: unknown device.
            NotFound: the encoder is not installed.
        """
        return super().load(bundle, device=device, threads=threads, dtype=dtype)

    @classmethod
    def _of(cls, bundle: Bundle, device: torch.device, dtype: torch.dtype) -> Self:
        config, networks = load_networks(bundle)
        spec = bundle.manifest.text
        if spec is None:
            raise InvalidBundle("names no text encoder", where=str(bundle.path))
        networks.to(device)
        batch_threads = BatchThreads.on(device)
        networks.masked.prepare_inference(dtype, batch_threads)
        if dtype != torch.float32:
            networks.tokenizer.decoder.prepare_inference(dtype)
        return cls(bundle, config, networks, WordReader(spec, config.text.max_words), device, dtype, batch_threads)

    def _drawing(
        self, requests: Sequence[Request], frames: Sequence[int], settings: SamplingSettings
    ) -> tuple[int, Draw[GeneratedMotion]]:
        inference = settings.inference(self.config.inference)
        words = self.reader.states([request.text.rewritten for request in requests])

        def draw(watcher: RowWatcher) -> list[GeneratedMotion]:
            own = watcher.rows
            items = self._items([requests[r] for r in own], [frames[r] for r in own], [words[r] for r in own])
            items = decode(self.networks.masked, items, self.scales, inference, watcher.step)
            return [self._generated(items, position, frames[row]) for position, row in enumerate(watcher.rows)]

        return inference.steps + 1, draw

    def _estimate(self, request: Request) -> int:
        """Return frames drawn by the length estimator, or, where the bundle has none, one of its `open_frames`."""
        if self.networks.length is None:
            seeds = torch.tensor([request.seed], device=self.device)
            draw = uniform(seeds, LENGTH_STREAM, 0, torch.zeros(1, dtype=torch.long, device=self.device))
            choices = self.config.open_frames
            return choices[min(int(draw * len(choices)), len(choices) - 1)]
        # From the middle third of the estimated distribution (ours): seeds differ, without extremes.
        logits = self.networks.length(self._sentence(request))
        tokens = draw_class(logits, request.seed, LENGTH_STREAM, middle=True) + 1
        return self.limits.within(tokens * self.frames_per_token)

    def _bucket(self, frames: int) -> int:
        return min(super()._bucket(frames), self.scales.longest)

    def _items(
        self, requests: Sequence[Request], frames: Sequence[int], words: Sequence[NDArray[np.float32]]
    ) -> ScaleItems:
        masked, device = self.networks.masked, self.device
        text = pad_states(words, self.config.text.max_words, device)
        tokens = torch.stack([self._kept_tokens(request) for request in requests])
        null = masked.words(text.states, torch.ones(len(requests), dtype=torch.bool, device=device))
        free = torch.tensor([r.free for r in requests], device=device)
        return ScaleItems(
            lengths=torch.tensor([self._tokens(f) for f in frames], device=device),
            seeds=torch.tensor([r.seed for r in requests], device=device),
            words=torch.where(free[:, None, None], null, masked.words(text.states)),
            null=null,
            present=torch.where(free[:, None], torch.arange(text.present.shape[1], device=device) == 0, text.present),
            tokens=tokens,
            kept=tokens != NO_TOKEN,
        )

    def _kept_tokens(self, request: Request) -> Tensor:
        """Return the tokens (N,) of the kept frames of a request; NO_TOKEN where a token covers another frame too."""
        if not request.kept or request.frames is None:
            return torch.full((self.scales.size,), NO_TOKEN, device=self.device)
        rate = self.frames_per_token
        features, is_kept = bridged(request.kept, request.frames)
        whole = torch.from_numpy(whole_tokens(features, rate)).to(self.device)[None]
        length = torch.tensor([whole.shape[1]], device=self.device)
        tokens = self.networks.tokenizer.encode(whole, length)[0, :, 0]
        kept = np.pad(is_kept, (0, -len(is_kept) % rate), mode="edge").reshape(-1, rate).all(1)  # (n,)
        return tokens.masked_fill(~self.scales.within(torch.from_numpy(kept).to(self.device)), NO_TOKEN)

    def _generated(self, items: ScaleItems, position: int, frames: int) -> GeneratedMotion:
        """Decode one item alone: a convolution rounds differently in another batch, and files would differ. Its tokens
        (1, N) are a block a scale, coarse to fine."""
        tokens, length = items.tokens[position : position + 1], items.lengths[position : position + 1]
        tokenizer, refiner = self.networks.tokenizer, self.networks.refiner
        features = tokenizer.decode(tokens[..., None], length)
        if refiner is not None:
            features = self._refined(refiner, features)
        return GeneratedMotion(tokens.cpu().numpy().astype(np.int16), features[0, :frames].cpu().numpy())

    def _refined(self, refiner: RootRefiner, features: Tensor) -> Tensor:
        """Replace the root's velocity by what the refiner makes of the other columns (1, T, D).

        It reads them as they are (ours): the published demo encodes the motion anew first and loses two frames.
        """
        normalized = self.networks.tokenizer.normalize(features)
        normalized[..., ROOT_VELOCITY] = refiner(normalized[..., inputs_of(self.config)])
        return self.networks.tokenizer.restore(normalized)
