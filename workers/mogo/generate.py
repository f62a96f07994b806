"""Prompts' features in, whole motions out: MOGO in batches, drawn by the streams that also serve live sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from shared.bundles import Bundle, find_bundle
from shared.errors import InvalidInput
from shared.motion.features import FeatureLayout, layout
from shared.nn.devices import choose_device, fast_bf16
from shared.text.features import TextFeatures
from workers.mogo.bundle import load_networks
from workers.mogo.config import InferenceConfig, MOGOConfig
from workers.mogo.model import RQHCTransformer
from workers.mogo.streaming import Streams
from workers.mogo.tokenizer import Tokenizer

MIN_FRAMES = 16
"""Shortest motion; a drawn end is not listened to before."""
MAX_SESSIONS = 32
"""Motions drawn side by side."""
MAX_SEED = 2**31 - 1


@dataclass(frozen=True)
class Request:
    """One motion to make."""

    text: TextFeatures
    seed: int
    frames: int | None = None  # at the model's fps; None = the model ends it


@dataclass(frozen=True)
class Settings:
    """Uniform over a batch; None = what the bundle says."""

    temperature: float | None = None
    top_k: float | None = None
    upper_temperature: float | None = None
    upper_top_k: float | None = None
    guidance: float | None = None

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
        self.dtype = dtype
        self.layout: FeatureLayout = layout(config.layout)

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
        if threads > 0:
            torch.set_num_threads(threads)
        chosen = choose_device(device)
        verified = find_bundle(bundle) if isinstance(bundle, str) else bundle
        config, tokenizer, transformer = load_networks(verified)
        dtype = dtype or (torch.bfloat16 if fast_bf16(chosen) else torch.float32)
        return cls(verified, config, tokenizer.to(chosen), transformer.to(chosen), dtype)

    @torch.inference_mode()
    def generate(self, requests: Sequence[Request], settings: Settings | None = None) -> list[Generated]:
        """Make one motion a request.

        The tokens of an item do not depend on the others, on their number or order.

        Raises:
            InvalidInput: a length or seed out of range, or features of another encoder.
        """
        inference = (settings or Settings()).inference(self.config.inference)
        for request in requests:
            self._check(request)
        columns: dict[int, list[torch.Tensor]] = {row: [] for row in range(len(requests))}
        waiting = list(range(len(requests)))[::-1]
        streams = Streams(self.transformer, min(MAX_SESSIONS, len(requests)), inference, dtype=self.dtype)
        playing: dict[int, int] = {}  # session to request
        while waiting or playing:
            while waiting and len(playing) < streams.capacity:
                row = waiting.pop()
                playing[self._start(streams, requests[row])] = row
            for session, column in streams.step().items():
                row = playing[session]
                ended = bool(column[0] < 0)
                if not ended:
                    columns[row].append(column)
                if ended or len(columns[row]) == (requests[row].frames or self.config.max_frames):
                    streams.stop(session)
                    del playing[session]
        return [self._decode(torch.stack(columns[row])) for row in range(len(requests))]

    def _start(self, streams: Streams, request: Request) -> int:
        sentence = torch.from_numpy(request.text.nodes[0].astype(np.float32)).to(self.transformer.head.weight.device)
        if request.frames is not None:
            return streams.start(sentence, request.seed)
        return streams.start(sentence, request.seed, ends_from=MIN_FRAMES)

    def _decode(self, tokens: torch.Tensor) -> Generated:
        """One by one: a convolution rounds differently in another batch, files would differ."""
        features = self.tokenizer.decode(tokens[None])[0]
        return Generated(tokens.T.cpu().numpy().astype(np.int16), features.cpu().numpy())

    def _check(self, request: Request) -> None:
        longest, fps = self.config.max_frames, self.config.fps
        if request.frames is not None and not min(MIN_FRAMES, longest) <= request.frames <= longest:
            raise InvalidInput(
                f"{request.frames} frames is out of range: this bundle makes {MIN_FRAMES / fps:g} to "
                f"{longest / fps:g} seconds",
                where="frames",
            )
        if not 0 <= request.seed <= MAX_SEED:
            raise InvalidInput(f"{request.seed} must lie between 0 and {MAX_SEED}", where="seed")
        if request.text.nodes.shape[1] != self.config.condition.text_width:
            raise InvalidInput(
                f"text features are {request.text.nodes.shape[1]} wide, this bundle reads "
                f"{self.config.condition.text_width}",
                where=request.text.prompt[:60],
                hint="They come from another encoder. Parse the prompt again for this bundle.",
            )
