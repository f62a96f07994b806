"""MoMask++'s inference behind one class: prompts to features of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle, InvalidInput
from marey.generation.base import GroupedGenerator, Sampling
from marey.generation.groups import RowWatcher
from marey.generation.kept import bridged, whole_tokens
from marey.generation.port import GenerationControl, Limits, Request, open_bundle
from marey.models.momaskpp.bundle import ScaleNetworks, load_networks
from marey.models.momaskpp.config import InferenceConfig, MoMaskPPConfig
from marey.models.momaskpp.decoding import BUCKET, LENGTH_STREAM, ScaleItems, bucket_of, decode
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


@dataclass(frozen=True)
class Generated:
    """One motion as the network generated it, before decoding to joints and clean-up."""

    tokens: NDArray[np.int16]  # (1, N): a block a scale, coarse to fine, -1 where the motion has no token
    features: NDArray[np.float32]  # (Tf, D), in the layout's own units


class Generator(GroupedGenerator[SamplingSettings, Generated]):
    """A loaded bundle. Not thread-safe; one per process."""

    sampling = SamplingSettings

    def __init__(
        self,
        bundle: Bundle,
        config: MoMaskPPConfig,
        networks: ScaleNetworks,
        reader: WordReader,
        device: torch.device,
        batch_threads: BatchThreads,
    ) -> None:
        limits = Limits(
            config.min_frames, config.max_frames, config.fps, config.text.width, keeps=config.tokenizer.frames_per_token
        )
        super().__init__(bundle, limits, config.inference, device, torch.float32, batch_threads)
        self.config = config
        self.networks = networks
        self.tokenizer = networks.tokenizer
        self.reader = reader
        self.scales = networks.tokenizer.scales

    @classmethod
    def load(
        cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: torch.dtype | None = None
    ) -> Generator:
        """Load a bundle, and the text encoder that it names: words are encoded here (docs/decisions/0026).

        Args:
            bundle: a verified bundle, or its name or path.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            threads: of torch; 0 leaves torch's own choice.
            dtype: float32 alone: published weights are compared in it.

        Raises:
            InvalidBundle: not MoMask++, damaged, or made with another text encoder than is installed.
            InvalidInput: unknown device, or another dtype.
            NotFound: the encoder is not installed.
        """
        if dtype not in (None, torch.float32):
            raise InvalidInput(f"runs in float32, not {dtype}", where="dtype")
        verified, chosen, _ = open_bundle(bundle, device, threads, torch.float32)
        config, networks = load_networks(verified)
        spec = verified.manifest.text
        if spec is None:
            raise InvalidBundle("names no text encoder", where=str(verified.path))
        for part in networks.parts().values():
            part.to(chosen)
        batch_threads = BatchThreads(torch.get_num_threads() if chosen.type == "cpu" else 1)
        networks.masked.prepare_inference(batch_threads)
        return cls(verified, config, networks, WordReader(spec, config.text.max_words), chosen, batch_threads)

    @property
    def frames_per_token(self) -> int:
        """Return N/n, the frames of a token of the full scale."""
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
        words = self.reader.states([request.text.rewritten for request in requests])

        def draw(watcher: RowWatcher) -> list[Generated]:
            own = watcher.rows
            items = self._items([requests[r] for r in own], [frames[r] for r in own], [words[r] for r in own])
            items = decode(self.networks.masked, items, self.scales, inference, watcher.step)
            return [self._generated(items, position, frames[row]) for position, row in enumerate(watcher.rows)]

        return self._in_groups(frames, inference.steps + 1, control, draw)

    def _estimate(self, request: Request) -> int:
        """Return frames drawn by the length estimator, or, where the bundle has none, one of its `open_frames`."""
        if self.networks.length is None:
            seeds = torch.tensor([request.seed], device=self.device)
            draw = uniform(seeds, LENGTH_STREAM, 0, torch.zeros(1, dtype=torch.long, device=self.device))
            choices = self.config.open_frames
            return choices[min(int(draw * len(choices)), len(choices) - 1)]
        # From the middle third of the estimated distribution (ours): seeds differ, without extremes.
        sentence = torch.from_numpy(request.text.sentence[None].astype(np.float32)).to(self.device)
        tokens = draw_class(self.networks.length(sentence), request.seed, LENGTH_STREAM, middle=True) + 1
        return self.limits.within(tokens * self.frames_per_token)

    def _bucket(self, frames: int) -> int:
        return bucket_of(self._tokens(frames), BUCKET, self.scales.longest)

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

    def _generated(self, items: ScaleItems, position: int, frames: int) -> Generated:
        """Decode one item alone: a convolution rounds differently in another batch, and files would differ."""
        tokens, length = items.tokens[position : position + 1], items.lengths[position : position + 1]
        tokenizer, refiner = self.networks.tokenizer, self.networks.refiner
        features = tokenizer.decode(tokens[..., None], length)
        if refiner is not None:
            features = self._refined(refiner, features)
        return Generated(tokens.cpu().numpy().astype(np.int16), features[0, :frames].cpu().numpy())

    def _refined(self, refiner: RootRefiner, features: Tensor) -> Tensor:
        """Replace the root's velocity by what the refiner makes of the other columns (1, T, D).

        It reads them as they are (ours): the published demo encodes the motion anew first and loses two frames.
        """
        normalized = self.networks.tokenizer.normalize(features)
        normalized[..., ROOT_VELOCITY] = refiner(normalized[..., inputs_of(self.config)])
        return self.networks.tokenizer.restore(normalized)
