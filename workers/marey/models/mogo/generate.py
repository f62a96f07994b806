"""MOGO's inference of whole motions in batches, drawn by the streams that also serve live sessions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.bundles.body import layout_of
from marey.core.errors import InvalidInput
from marey.generation.base import GeneratedMotion, SampledGenerator, Sampling
from marey.generation.port import GenerationControl, Limits, NoControl, Request
from marey.models.mogo.bundle import Networks, load_networks
from marey.models.mogo.config import InferenceConfig, MOGOConfig
from marey.models.mogo.packed_model import PackedModel, sessions_of_product
from marey.models.mogo.spec import SPEC
from marey.models.mogo.state import NEVER
from marey.models.mogo.streaming import StreamBatch
from marey.motion.features import FeatureLayout
from marey.text.features import TextFeatures

MAX_SESSIONS = 32
"""Motions drawn in parallel."""


@dataclass(frozen=True)
class SamplingSettings(Sampling[InferenceConfig]):
    """Sampling settings, uniform over a batch; None = the bundle's value."""

    spec = SPEC

    temperature: float | None = None
    top_k: float | None = None
    upper_temperature: float | None = None
    upper_top_k: float | None = None
    guidance: float | None = None
    upper_guidance: float | None = None


class Generator(SampledGenerator[SamplingSettings]):
    """A loaded bundle. Not thread-safe; one per process."""

    sampling = SamplingSettings

    def __init__(
        self,
        bundle: Bundle,
        config: MOGOConfig,
        networks: Networks,
        dtype: torch.dtype,
    ) -> None:
        """Create a generator from its parts; most callers use `load`."""
        self.bundle, self.config, self.inference = bundle, config, config.inference
        self.tokenizer, self.transformer = networks.tokenizer, networks.transformer
        self.device, self.dtype = self.transformer.head.weight.device, dtype
        self.layout: FeatureLayout = layout_of(bundle.manifest)
        self.limits = Limits(config.min_frames, config.longest, config.fps, config.condition.text_width)
        self.batch = MAX_SESSIONS
        self._packed: dict[int, PackedModel] = {}
        self._streams: tuple[InferenceConfig, StreamBatch] | None = None

    @classmethod
    def _of(cls, bundle: Bundle, device: torch.device, dtype: torch.dtype) -> Self:
        config, networks = load_networks(bundle)
        networks.to(device)
        return cls(bundle, config, networks, dtype)

    def packed(self, sessions: int = MAX_SESSIONS) -> PackedModel:
        """Return the packed model for up to `sessions` motions in parallel, built once per shape; its products have the
        same shape for any number of motions, so tokens do not depend on it."""
        group = sessions_of_product(self.transformer, sessions) if self.device.type == "cpu" else 1
        if group not in self._packed:
            self._packed[group] = PackedModel(self.transformer, dtype=self.dtype, group=group)
        return self._packed[group]

    def resolve_length(self, request: Request) -> Request:
        """Check the request and return it unchanged: an open length is decided while drawing."""
        self.limits.check(request)
        return request

    def bucket(self, request: Request) -> int:
        """Return one bucket for all: sessions of any length run in parallel."""
        return 1

    def actions(self, text: TextFeatures) -> tuple[torch.Tensor, list[int]]:
        """Return the action vectors of a prompt (A, W), and the usual frames of each (A,).

        Where the bundle's text pipeline does not split prompts, the sentence is the one action.
        """
        spec = self.bundle.manifest.text
        vectors = text.action_vectors if spec is None or spec.split_actions else text.nodes[:1]
        actions = torch.from_numpy(vectors.astype(np.float32)).to(self.device)
        return actions, self.transformer.natural_frames(actions)

    def streams(self, count: int, inference: InferenceConfig) -> StreamBatch:
        """Return empty streams for `count` motions. On a GPU those of the last batch are reused if settings are equal:
        recording a step takes as long as drawing a motion."""
        if self.device.type == "cpu":
            return StreamBatch(self.packed(), max(1, min(MAX_SESSIONS, count)), inference)
        if self._streams is None or self._streams[0] != inference:
            self._streams = None  # release its memory first
            self._streams = inference, StreamBatch(self.packed(), MAX_SESSIONS, inference)
        return self._streams[1]

    @torch.inference_mode()
    def generate(
        self,
        requests: Sequence[Request],
        settings: SamplingSettings | None = None,
        *,
        control: GenerationControl | None = None,
    ) -> list[GeneratedMotion | None]:
        """Generate one motion per request; None where `control` dropped it.

        The tokens of an item do not depend on the number or order of the others.

        Raises:
            InvalidInput: a length or seed out of range, or features of another encoder.
        """
        inference = (settings or SamplingSettings()).inference(self.config.inference)
        control = control or NoControl()
        for request in requests:
            self.limits.check(request)
        recorded = {row: self.columns(r.recording.tokens) for row, r in enumerate(requests) if r.recording is not None}
        drawing = _Drawing(self, requests, inference, recorded)
        try:
            while drawing.step(control.dropped()):
                control.progress(drawing.done, drawing.total)
        finally:
            drawing.close()
        control.progress(drawing.total, drawing.total)
        return [None if columns is None else self._decode(torch.stack(columns)) for columns in drawing.columns]

    def columns(self, tokens: NDArray[np.int16]) -> torch.Tensor:
        """Move tokens (n, V) of another process to this device.

        Raises:
            InvalidInput: not tokens of this bundle.
        """
        config = self.config.tokenizer
        if tokens.ndim != 2 or tokens.shape[1] != config.levels or tokens.min() < 0 or tokens.max() >= config.codes:
            wanted = f"(n, {config.levels}) codes from 0 to {config.codes - 1}"
            raise InvalidInput(f"tokens {tokens.shape} are not {wanted}", where="tokens")
        return torch.from_numpy(tokens.astype(np.int64)).to(self.device)

    def _decode(self, tokens: torch.Tensor) -> GeneratedMotion:
        """Decode one by one: a convolution rounds differently in another batch, and files would differ."""
        features = self.tokenizer.decode(tokens[None])[0]
        return GeneratedMotion(tokens.T.cpu().numpy().astype(np.int16), features.cpu().numpy())


class _Drawing:
    """Requests in progress in the sessions of one `StreamBatch`."""

    def __init__(
        self,
        generator: Generator,
        requests: Sequence[Request],
        inference: InferenceConfig,
        recorded: Mapping[int, torch.Tensor],
    ) -> None:
        self._generator, self.requests = generator, requests
        self.columns: list[list[torch.Tensor] | None] = [  # None: dropped
            list(recorded[row].unbind()) if row in recorded else [] for row in range(len(requests))
        ]
        self.lasts = [self._lasts(request) for request in requests]
        self.frames = [sum(lasts) for lasts in self.lasts]
        self.total = sum(len(recorded[row]) if row in recorded else self.frames[row] for row in range(len(requests)))
        self.waiting = [row for row in range(len(requests)) if row not in recorded][::-1]
        self.playing: dict[int, int] = {}  # session to request
        self.streams = generator.streams(len(requests), inference)

    @property
    def done(self) -> int:
        """Return the frames drawn so far."""
        return sum(len(columns or ()) for columns in self.columns)

    def step(self, dropped: set[int]) -> bool:
        """Draw one frame of every session; return False when none is left."""
        self._leave_out(dropped)
        while self.waiting and len(self.playing) < self.streams.capacity:
            row = self.waiting.pop()
            self.playing[self._start(self.requests[row], self.lasts[row])] = row
        if not self.playing:
            return False
        drawn = self.streams.step()
        ends = (torch.stack(list(drawn.values()))[:, 0] < 0).tolist()  # one transfer from the device for all of them
        for (session, column), ended in zip(drawn.items(), ends, strict=True):
            row = self.playing[session]
            columns = self.columns[row]
            assert columns is not None
            if not ended:
                columns.append(column)
            if ended or len(columns) == self.frames[row]:
                self._stop(session)
        return True

    def close(self) -> None:
        """Stop all sessions."""
        for session in list(self.playing):
            self._stop(session)

    def _leave_out(self, dropped: set[int]) -> None:
        self.waiting = [row for row in self.waiting if row not in dropped]
        for session, row in list(self.playing.items()):
            if row in dropped:
                self._stop(session)
        for row in dropped:
            self.columns[row] = None

    def _start(self, request: Request, lasts: Sequence[int]) -> int:
        actions, natural = self._generator.actions(request.text)
        if sum(lasts) > self._generator.config.max_frames:
            # its clock stops as in a live stream: where training motions end, gaits slow down
            lasts = [*lasts[:-1], min(lasts[-1], natural[-1])]
        ends_from = NEVER if request.frames is not None else self._generator.config.min_frames
        return self.streams.start(actions, request.seed, ends_from=ends_from, lasts=lasts)

    def _lasts(self, request: Request) -> list[int]:
        """Return the frames of each action: in natural proportion, in total the requested or the largest possible
        length."""
        natural = np.array(self._generator.actions(request.text)[1])
        whole = request.frames or min(int(natural.sum()), self._generator.config.longest)
        return np.diff(np.round(np.cumsum([0, *natural]) * whole / natural.sum())).astype(int).tolist()

    def _stop(self, session: int) -> None:
        self.streams.stop(session)
        del self.playing[session]
