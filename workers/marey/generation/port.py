"""What the handler, the command line and the exports know of a model's generator."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidInput
from marey.items.item import MAX_SEED
from marey.motion.features import FeatureLayout
from marey.nn.devices import choose_device, fast_bf16
from marey.streams.recording import Recording
from marey.text.features import TextFeatures


@dataclass(frozen=True)
class Request:
    """One motion to make."""

    text: TextFeatures
    seed: int
    frames: int | None = None  # at the model's fps; None = the model decides
    recording: Recording | None = None  # of a live stream: drawn already, only to be decoded


@dataclass(frozen=True)
class Limits:
    """What a bundle can make."""

    min_frames: int
    max_frames: int
    fps: float
    text_width: int

    def check(self, request: Request) -> None:
        """Nothing, if a request lies within them.

        Raises:
            InvalidInput: a length or seed out of range, or features of another encoder.
        """
        low, high = self.min_frames, self.max_frames
        frames = request.frames if request.recording is None else None
        if frames is not None and not low <= frames <= high:
            seconds = f"{low / self.fps:g} to {high / self.fps:g} seconds"
            raise InvalidInput(f"{frames} frames is out of range: this bundle makes {seconds}", where="frames")
        if not 0 <= request.seed <= MAX_SEED:
            raise InvalidInput(f"{request.seed} must lie between 0 and {MAX_SEED}", where="seed")
        width = request.text.nodes.shape[1]
        if width != self.text_width:
            raise InvalidInput(
                f"text features are {width} wide, this bundle reads {self.text_width}",
                where="text",
                hint="They come from another encoder. Parse the prompt again for this bundle.",
            )


def open_bundle(
    bundle: Bundle | str, device: str, threads: int, dtype: torch.dtype | None
) -> tuple[Bundle, torch.device, torch.dtype]:
    """What every generator's `load` begins with: the verified bundle, its device and the type of its matrices.

    Args:
        bundle: a verified bundle, or its name or path.
        device: `auto`, `cpu`, `cuda`, `cuda:N`.
        threads: of torch; 0 leaves torch's own choice.
        dtype: None = bfloat16 where the device multiplies it fast, else float32.

    Raises:
        NotFound, InvalidBundle, Refused: see `find_bundle`.
        InvalidInput: no such device.
    """
    if threads > 0:
        torch.set_num_threads(threads)
    chosen = choose_device(device)
    verified = find_bundle(bundle) if isinstance(bundle, str) else bundle
    return verified, chosen, dtype or (torch.bfloat16 if fast_bf16(chosen) else torch.float32)


class Control(Protocol):
    """What a caller may do while a batch is made."""

    def progress(self, done: int, total: int) -> None:
        """Called after each step of the batch."""
        ...

    def dropped(self) -> set[int]:
        """Indices of requests to leave out from now on (cancelled)."""
        ...


class NoControl:
    """Nobody listens, nobody is left out."""

    def progress(self, done: int, total: int) -> None:
        """Nothing."""

    def dropped(self) -> set[int]:
        """Nobody."""
        return set()


class Generated(Protocol):
    """One motion as the network made it: before decoding to joints and clean-up."""

    @property
    def tokens(self) -> NDArray[np.int16]:
        """(V, n): levels and tokens."""
        ...

    @property
    def features(self) -> NDArray[np.float32]:
        """(T, D), in the layout's own units."""
        ...


S = TypeVar("S")
"""A model's own settings of drawing, uniform over a batch."""


def read_settings(kind: Callable[..., S], values: Mapping[str, Any], known: Iterable[str]) -> S:
    """The settings in `values`.

    Raises:
        InvalidInput: one that is not among `known`.
    """
    for name in values:
        if name not in known:
            raise InvalidInput(f"is not a setting of this model; known are {', '.join(known)}", where=name)
    return kind(**values)


class Generator(Protocol[S]):
    """A loaded bundle. Not thread-safe; one a process."""

    bundle: Bundle
    layout: FeatureLayout
    device: torch.device
    dtype: torch.dtype
    limits: Limits
    batch: int
    """Motions made side by side, at most."""

    def settings(self, values: Mapping[str, Any]) -> S:
        """An item's settings, checked.

        Raises:
            InvalidInput: not a setting of this model, or out of range.
        """
        ...

    def described(self, settings: S) -> dict[str, Any]:
        """Everything that decides how tokens are drawn: the bundle's own values with these changes."""
        ...

    def settled(self, request: Request) -> Request:
        """The request with its length decided, where the model decides lengths beforehand.

        Raises:
            InvalidInput: as `Limits.check`.
        """
        ...

    def bucket(self, request: Request) -> int:
        """Settled requests of one bucket share a forward; a smaller bucket costs less."""
        ...

    def generate(
        self, requests: Sequence[Request], settings: S | None = None, *, control: Control | None = None
    ) -> Sequence[Generated | None]:
        """One motion a request; None where `control` dropped it.

        The tokens of an item do not depend on the others, on their number or order.

        Raises:
            InvalidInput: as `Limits.check`.
        """
        ...
