"""Interface of a model's generator, as the handler, the command line and the exports use it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import Bundle, find_bundle
from marey.core.errors import InvalidInput
from marey.generation.posture import NO_POSTURE, RowPosture
from marey.generation.timed import TimedText
from marey.items.values import MAX_SEED
from marey.motion.features import FeatureLayout
from marey.nn.devices import choose_device, fast_bf16
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.text.features import TextFeatures

if TYPE_CHECKING:
    from marey.streams.recording import StreamRecording  # it would import the database


@dataclass(frozen=True, eq=False)
class KeptFrames:
    """Frames that stand in a motion already: the model reads them, and generates those around them.

    Attributes:
        start: first frame of the motion that they are.
        features: (t, D), in the layout's own units.
    """

    start: int
    features: NDArray[np.float32] = field(repr=False)

    @property
    def end(self) -> int:
        """Return the frame after the last."""
        return self.start + len(self.features)


@dataclass(frozen=True)
class Request:
    """Request for one motion."""

    text: TextFeatures
    seed: int
    frames: int | None = None  # at the model's fps; None = the model decides
    recording: StreamRecording | None = None  # of a live stream: tokens exist, only decoding is left
    scope: Mapping[str, Any] | None = None  # of the prompt, for the manifest; None = by its words
    kept: tuple[KeptFrames, ...] = ()  # in the order of time; needs `frames`
    free: bool = False  # the text is not read: kept frames alone decide
    timeline: tuple[TimedText, ...] | None = None  # prompts at stated times; `text` is that of the first
    open: bool = False  # `frames` were not asked for: what the prompt asks for may need more or fewer
    beside: tuple[str, str] = ("", "")  # prompts of the rows of a timeline before and after it; empty = none
    held: RowPosture = NO_POSTURE  # postures of the row of a sequence
    drawing: bool = True  # rules may draw movements; else the network makes all of it

    @property
    def is_sequence(self) -> bool:
        """True if the rows of the timeline are the movements of one prompt."""
        return self.timeline is not None and bool(self.text.movements)


@dataclass(frozen=True)
class Limits:
    """Range of lengths and seeds that a bundle accepts."""

    min_frames: int
    max_frames: int
    fps: float
    text_width: int
    keeps: int = 0  # kept frames begin and end at multiples of it; 0 = the model cannot generate around frames

    def frames_of(self, seconds: float | None, text: TextFeatures | None = None) -> int | None:
        """Return the frames of a length, or of what the rewriter of a prompt proposes, brought into the range of the
        bundle; None = the model decides."""
        if seconds is not None:
            return round(seconds * self.fps)
        if text is None or text.seconds is None:
            return None
        return self.within(round(text.seconds * self.fps))

    def within(self, frames: int) -> int:
        """Return a number of frames, brought into the range of the bundle."""
        return min(max(frames, self.min_frames), self.max_frames)

    def check(self, request: Request) -> None:
        """Check that a request is within the limits.

        Raises:
            InvalidInput: a length or seed out of range, features of another encoder, or kept frames that overlap, lie
                outside the motion or between tokens.
        """
        low, high = self.min_frames, self.max_frames
        frames = request.frames if request.recording is None else None
        if frames is not None and not low <= frames <= high:
            seconds = f"{low / self.fps:g} to {high / self.fps:g} seconds"
            raise InvalidInput(f"{frames} frames is out of range; this bundle generates {seconds}", where="frames")
        if not 0 <= request.seed <= MAX_SEED:
            raise InvalidInput(f"{request.seed} is out of range; allowed: 0 to {MAX_SEED}", where="seed")
        width = request.text.nodes.shape[1]
        if width != self.text_width:
            raise InvalidInput(
                f"text features have width {width}; this bundle reads {self.text_width}",
                where="text",
                hint="They come from another encoder. Parse the prompt again for this bundle.",
            )
        if request.kept:
            self._check_kept(request)

    def _check_kept(self, request: Request) -> None:
        """Check that kept frames lie within the motion, in order, on the grid of the model's tokens."""
        if not self.keeps:
            raise InvalidInput("this model cannot generate frames around others", where="kept")
        if request.frames is None:
            raise InvalidInput("a motion with kept frames needs a length", where="frames")
        before = 0
        for span in request.kept:
            if span.start < before or span.end > request.frames or not len(span.features):
                raise InvalidInput(
                    f"frames {span.start} to {span.end} overlap others or lie outside the motion", where="kept"
                )
            if span.start % self.keeps or (span.end % self.keeps and span.end != request.frames):
                raise InvalidInput(
                    f"frames {span.start} to {span.end} do not begin and end at multiples of {self.keeps}", where="kept"
                )
            before = span.end
        if sum(len(span.features) for span in request.kept) == request.frames:
            raise InvalidInput("all frames are kept; none is left to generate", where="kept")


def open_bundle(
    bundle: Bundle | str, device: str, threads: int, dtype: torch.dtype | None
) -> tuple[Bundle, torch.device, torch.dtype]:
    """Open a verified bundle and choose its device and number type: the first step of every generator's `load`.

    Args:
        bundle: a verified bundle, or its name or path.
        device: `auto`, `cpu`, `cuda`, `cuda:N`.
        threads: of torch; 0 = torch's default.
        dtype: None = bfloat16 where the device multiplies it fast, else float32.

    Returns:
        the bundle, the device and the type of the matrices.

    Raises:
        NotFound, InvalidBundle, Refused: see `find_bundle`.
        InvalidInput: unknown device.
    """
    if threads > 0:
        torch.set_num_threads(threads)
    chosen = choose_device(device)
    verified = find_bundle(bundle) if isinstance(bundle, str) else bundle
    return verified, chosen, dtype or (torch.bfloat16 if fast_bf16(chosen) else torch.float32)


class GenerationControl(Protocol):
    """Progress reports and cancellation of a running batch."""

    def progress(self, done: int, total: int) -> None:
        """Report progress; called after each step of the batch."""
        ...

    def dropped(self) -> set[int]:
        """Return indices of requests to leave out from now on (cancelled)."""
        ...


class NoControl:
    """Control that ignores progress and cancels nothing."""

    def progress(self, done: int, total: int) -> None:
        """Ignore the report."""

    def dropped(self) -> set[int]:
        """Return the empty set."""
        return set()


class MotionFeatures(Protocol):
    """One motion before decoding to joints and clean-up."""

    @property
    def features(self) -> NDArray[np.float32]:
        """(T, D), in the layout's own units."""
        ...


class Generated(MotionFeatures, Protocol):
    """One motion as the network generated it."""

    @property
    def tokens(self) -> NDArray[np.int16]:
        """(V, n): levels and tokens."""
        ...


S = TypeVar("S")
"""A model's own sampling settings, uniform over a batch."""


def read_settings(kind: Callable[..., S], values: Mapping[str, Any], known: Iterable[str]) -> S:
    """Build a model's settings from `values`.

    Raises:
        InvalidInput: a name that is not among `known`.
    """
    for name in values:
        if name not in known:
            raise InvalidInput(f"unknown setting; this model has {', '.join(known)}", where=name)
    return kind(**values)


class Generator(Protocol[S]):
    """A loaded bundle. Not thread-safe; one per process."""

    bundle: Bundle
    layout: FeatureLayout
    device: torch.device
    dtype: torch.dtype
    limits: Limits
    batch: int
    """Largest number of motions of one forward pass."""

    def settings(self, values: Mapping[str, Any]) -> S:
        """Check an item's settings.

        Raises:
            InvalidInput: an unknown setting, or a value out of range.
        """
        ...

    def describe_settings(self, settings: S) -> dict[str, Any]:
        """Return all settings that decide how tokens are drawn: the bundle's, with these changes."""
        ...

    def resolve_length(self, request: Request) -> Request:
        """Return the request with its length set, where the model decides lengths beforehand.

        Raises:
            InvalidInput: as `Limits.check`.
        """
        ...

    def bucket(self, request: Request) -> int:
        """Return the bucket of a request with a set length; requests of one bucket share a forward pass.

        A smaller bucket costs less.
        """
        ...

    def generate(
        self, requests: Sequence[Request], settings: S | None = None, *, control: GenerationControl | None = None
    ) -> Sequence[Generated | None]:
        """Generate one motion per request; None where `control` dropped it.

        The tokens of an item do not depend on the number or order of the others.

        Raises:
            InvalidInput: as `Limits.check`.
        """
        ...


class KeepingGenerator(Generator[S], Protocol[S]):
    """A generator that keeps frames of a motion: its limits have `keeps`."""

    tokenizer: MotionTokenizer
