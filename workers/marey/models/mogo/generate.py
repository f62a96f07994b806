"""Prompts' features in, whole motions out: MOGO in batches, drawn by the streams that also serve live sessions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.core.errors import InvalidInput
from marey.generation.port import Control, Limits, NoControl, Request, open_bundle, read_settings
from marey.models.mogo.bundle import load_networks
from marey.models.mogo.config import InferenceConfig, MOGOConfig
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.packed_model import PackedModel, sessions_of_product
from marey.models.mogo.state import NEVER
from marey.models.mogo.streaming import Streams
from marey.models.mogo.tokenizer import Tokenizer
from marey.motion.features import FeatureLayout, layout
from marey.text.features import TextFeatures

MAX_SESSIONS = 32
"""Motions drawn side by side."""


@dataclass(frozen=True)
class Settings:
    """Uniform over a batch; None = what the bundle says."""

    temperature: float | None = None
    top_k: float | None = None
    upper_temperature: float | None = None
    upper_top_k: float | None = None
    guidance: float | None = None
    upper_guidance: float | None = None

    def inference(self, default: InferenceConfig) -> InferenceConfig:
        """The bundle's drawing with this batch's changes.

        Raises:
            InvalidInput: a value out of range.
        """
        changed = {name: value for name, value in vars(self).items() if value is not None}
        for name, value in changed.items():
            if name.endswith("top_k") and not 0 < value <= 1:
                raise InvalidInput("must lie in (0, 1]: the share of codes that may be drawn", where=name)
            if not 0 <= value <= 100:
                raise InvalidInput("must lie between 0 and 100", where=name)
        return replace(default, **changed)


@dataclass(frozen=True)
class Generated:
    """One motion as the network made it: before decoding to joints and clean-up."""

    tokens: NDArray[np.int16]  # (V, T)
    features: NDArray[np.float32]  # (T, D), in the layout's own units


class Generator:
    """A loaded bundle. Not thread-safe; one a process."""

    def __init__(
        self,
        bundle: Bundle,
        config: MOGOConfig,
        tokenizer: Tokenizer,
        transformer: RQHCTransformer,
        dtype: torch.dtype,
    ) -> None:
        """Put a generator together; most callers want `load`."""
        self.bundle, self.config = bundle, config
        self.tokenizer, self.transformer = tokenizer, transformer
        self.device, self.dtype = transformer.head.weight.device, dtype
        self.layout: FeatureLayout = layout(config.layout)
        self.limits = Limits(config.min_frames, config.max_frames, config.fps, config.condition.text_width)
        self.batch = MAX_SESSIONS
        self._packed: dict[int, PackedModel] = {}
        self._streams: tuple[InferenceConfig, Streams] | None = None

    @classmethod
    def load(
        cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: torch.dtype | None = None
    ) -> Generator:
        """Load a bundle.

        Args:
            bundle: a verified bundle, or its name or path.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            threads: of torch; 0 leaves torch's own choice.
            dtype: of the matrices on a CPU; None = bfloat16 where that is fast, else float32.

        Raises:
            InvalidBundle: not MOGO, or damaged.
            InvalidInput: no such device.
        """
        verified, chosen, dtype = open_bundle(bundle, device, threads, dtype)
        config, tokenizer, transformer = load_networks(verified)
        return cls(verified, config, tokenizer.to(chosen), transformer.to(chosen), dtype)

    def packed(self, sessions: int = MAX_SESSIONS) -> PackedModel:
        """What draws up to so many motions side by side; products of the same shape for any number of them, so the same
        tokens. Made once for each shape."""
        group = sessions_of_product(self.transformer, sessions) if self.device.type == "cpu" else 1
        if group not in self._packed:
            self._packed[group] = PackedModel(self.transformer, dtype=self.dtype, group=group)
        return self._packed[group]

    def settings(self, values: Mapping[str, Any]) -> Settings:
        """An item's settings, checked. Raises InvalidInput."""
        settings = read_settings(Settings, values, Settings.__dataclass_fields__)
        settings.inference(self.config.inference)
        return settings

    def described(self, settings: Settings) -> dict[str, Any]:
        """Everything that decides how tokens are drawn."""
        return asdict(settings.inference(self.config.inference))

    def settled(self, request: Request) -> Request:
        """The request itself, checked: an open length is decided while it is drawn."""
        self.limits.check(request)
        return request

    def bucket(self, request: Request) -> int:
        """One for all: sessions of any length go side by side."""
        return 1

    def acts(self, text: TextFeatures) -> tuple[torch.Tensor, list[int]]:
        """The acts of a prompt (A, W), and the frames that each usually takes (A,)."""
        acts = torch.from_numpy(text.act_vectors.astype(np.float32)).to(self.device)
        return acts, self.transformer.natural_frames(acts)

    def streams(self, count: int, inference: InferenceConfig) -> Streams:
        """Room for a batch of so many motions, empty. On a GPU that of the last batch, where it was drawn likewise: to
        record a step takes as long as to draw a motion."""
        if self.device.type == "cpu":
            return Streams(self.packed(), max(1, min(MAX_SESSIONS, count)), inference)
        if self._streams is None or self._streams[0] != inference:
            self._streams = None  # its memory first
            self._streams = inference, Streams(self.packed(), MAX_SESSIONS, inference)
        return self._streams[1]

    @torch.inference_mode()
    def generate(
        self, requests: Sequence[Request], settings: Settings | None = None, *, control: Control | None = None
    ) -> list[Generated | None]:
        """Make one motion a request; None where `control` dropped it.

        The tokens of an item do not depend on the others, on their number or order.

        Raises:
            InvalidInput: a length or seed out of range, or features of another encoder.
        """
        inference = (settings or Settings()).inference(self.config.inference)
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
        """Tokens (n, V) that were drawn elsewhere, on this device.

        Raises:
            InvalidInput: they are none of this bundle's.
        """
        config = self.config.tokenizer
        if tokens.ndim != 2 or tokens.shape[1] != config.levels or tokens.min() < 0 or tokens.max() >= config.codes:
            wanted = f"(n, {config.levels}) codes from 0 to {config.codes - 1}"
            raise InvalidInput(f"tokens {tokens.shape} are not {wanted}", where="tokens")
        return torch.from_numpy(tokens.astype(np.int64)).to(self.device)

    def _decode(self, tokens: torch.Tensor) -> Generated:
        """One by one: a convolution rounds differently in another batch, files would differ."""
        features = self.tokenizer.decode(tokens[None])[0]
        return Generated(tokens.T.cpu().numpy().astype(np.int16), features.cpu().numpy())


class _Drawing:
    """Requests on their way through the sessions of one `Streams`."""

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
        """Frames drawn."""
        return sum(len(columns or ()) for columns in self.columns)

    def step(self, dropped: set[int]) -> bool:
        """Draw one frame of every session; False when there is none left."""
        self._leave_out(dropped)
        while self.waiting and len(self.playing) < self.streams.capacity:
            row = self.waiting.pop()
            self.playing[self._start(self.requests[row], self.lasts[row])] = row
        if not self.playing:
            return False
        drawn = self.streams.step()
        ends = (torch.stack(list(drawn.values()))[:, 0] < 0).tolist()  # the device is asked once for all of them
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
        """Leave the room, whatever became of the requests."""
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
        acts, _ = self._generator.acts(request.text)
        ends_from = NEVER if request.frames is not None else self._generator.config.min_frames
        return self.streams.start(acts, request.seed, ends_from=ends_from, lasts=lasts)

    def _lasts(self, request: Request) -> list[int]:
        """Frames of each act: as many as is natural, together as many as are asked for or can be made at most."""
        natural = np.array(self._generator.acts(request.text)[1])
        whole = request.frames or min(int(natural.sum()), self._generator.config.max_frames)
        return np.diff(np.round(np.cumsum([0, *natural]) * whole / natural.sum())).astype(int).tolist()

    def _stop(self, session: int) -> None:
        self.streams.stop(session)
        del self.playing[session]
