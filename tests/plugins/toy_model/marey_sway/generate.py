"""Generate features from requests, and handle the queue `sway`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.bundles import Bundle
from marey.core.settings import settings as process_settings
from marey.generation.handler import GeneratorHandler
from marey.generation.port import GenerationControl, Limits, NoControl, Request, open_bundle, read_settings
from marey.motion.features import layout
from marey_sway.config import Inference, SwayConfig

BATCH = 8


@dataclass(frozen=True)
class SamplingSettings:
    """Settings uniform over a batch; None = the bundle's value."""

    width: float | None = None
    beats: int | None = None


@dataclass(frozen=True)
class Generated:
    """One motion: no tokens, and its features."""

    tokens: NDArray[np.int16]  # (1, n)
    features: NDArray[np.float32]  # (T, D)


class Generator:
    """A loaded bundle; see `marey.generation.port.Generator`."""

    batch = BATCH

    def __init__(self, bundle: Bundle, device: Any, dtype: Any) -> None:
        self.bundle, self.device, self.dtype = bundle, device, dtype
        self.config = SwayConfig.from_dict(bundle.manifest.parameters)
        self.layout = layout(self.config.layout)
        assert bundle.manifest.text is not None
        self.limits = Limits(
            self.config.min_frames, self.config.max_frames, self.config.fps, bundle.manifest.text.width
        )
        self._frame = bundle.tensors("pose")["frame"]

    @classmethod
    def load(cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: Any = None) -> Generator:
        """Load a bundle."""
        return cls(*open_bundle(bundle, device, threads, dtype))

    def settings(self, values: Mapping[str, Any]) -> SamplingSettings:
        """Check an item's settings."""
        return read_settings(SamplingSettings, values, SamplingSettings.__dataclass_fields__)

    def describe_settings(self, settings: SamplingSettings) -> dict[str, Any]:
        """Return everything that decides a motion."""
        return asdict(self._inference(settings))

    def resolve_length(self, request: Request) -> Request:
        """Return the request with its length set."""
        self.limits.check(request)
        return replace(request, frames=request.frames or 40)

    def bucket(self, request: Request) -> int:
        """Put all lengths in one bucket."""
        return 1

    def generate(
        self,
        requests: Sequence[Request],
        settings: SamplingSettings | None = None,
        *,
        control: GenerationControl | None = None,
    ) -> Sequence[Generated | None]:
        """Generate one motion per request."""
        inference, control = self._inference(settings or SamplingSettings()), control or NoControl()
        made = [self._sway(request, inference) for request in requests]
        control.progress(1, 1)
        dropped = control.dropped()
        return [None if row in dropped else each for row, each in enumerate(made)]

    def _inference(self, settings: SamplingSettings) -> Inference:
        changed = {name: value for name, value in vars(settings).items() if value is not None}
        return replace(self.config.inference, **changed)

    def _sway(self, request: Request, inference: Inference) -> Generated:
        assert request.frames is not None
        phase = 2 * np.pi * inference.beats * np.arange(request.frames + 1) / request.frames + request.seed
        features = np.tile(self._frame, (request.frames, 1)).astype(np.float32)
        features[:, :3] = 0.0  # turn of the root, and its speed
        sign = 1.0 if self.config.side == "left" else -1.0
        features[:, 1] = sign * inference.width / 2 * np.diff(np.sin(phase))
        return Generated(np.zeros((1, request.frames), np.int16), features)


def create_handler() -> GeneratorHandler[SamplingSettings]:
    """Create the handler of the queue."""
    return GeneratorHandler("sway", Generator.load, BATCH, process_settings())
