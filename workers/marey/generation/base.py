"""Bases of the generators of Marey's models: loading, reading of settings, open lengths, and passes over groups of
equal length. A model may have its own instead: `marey.generation.port.Generator` is all that others know of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle
from marey.bundles.body import layout_of
from marey.core.errors import InvalidInput
from marey.generation.groups import MAX_ROWS, RowWatcher, StepCounter, group_rows, to_bucket
from marey.generation.port import GenerationControl, Limits, NoControl, Request, open_bundle, read_settings
from marey.motion.features import FeatureLayout
from marey.nn.batch_threads import BatchThreads
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.registry import ModelSpec

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

C = TypeVar("C", bound="DataclassInstance")
"""A bundle's values of the settings, and other numbers that decide how tokens are drawn."""


@dataclass(frozen=True)
class Sampling(Generic[C]):
    """Base class of a model's sampling settings, uniform over a batch; None = the bundle's value.

    Attributes:
        spec: of the model; declares the ranges.
    """

    spec: ClassVar[ModelSpec]

    def inference(self, default: C) -> C:
        """Return the bundle's values with these changes.

        Raises:
            InvalidInput: a value out of the range that the model declares; `where` is the setting.
        """
        given = {each.name: getattr(self, each.name, None) for each in fields(default)}
        config = replace(default, **{name: value for name, value in given.items() if value is not None})
        for setting in self.spec.settings:
            if problem := setting.problem(getattr(config, setting.name)):
                raise InvalidInput(problem, where=setting.name)
        return config


P = TypeVar("P", bound=Sampling[Any])
"""Sampling settings of a model."""
G = TypeVar("G")
"""One motion as a model generates it, such as `GeneratedMotion`."""
Draw = Callable[[RowWatcher], Sequence[G]]
"""Generates the rows of a group, and returns those that its watcher still has at the end."""


@dataclass(frozen=True)
class GeneratedMotion:
    """One motion as the network generated it, before decoding to joints and clean-up."""

    tokens: NDArray[np.int16]  # (V, n): levels and tokens; -1 = none
    features: NDArray[np.float32]  # (T, D), in the layout's own units


class SampledGenerator(ABC, Generic[P]):
    """A generator whose bundle holds a value of every setting.

    Attributes:
        sampling: the model's settings.
        inference: the bundle's values of them, and of other numbers that no request changes.
    """

    sampling: type[P]
    inference: DataclassInstance

    @classmethod
    def load(
        cls, bundle: Bundle | str, *, device: str = "auto", threads: int = 0, dtype: torch.dtype | None = None
    ) -> Self:
        """Load a bundle.

        Args:
            bundle: a verified bundle, or its name or path.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            threads: of torch; 0 leaves torch's own choice.
            dtype: of the transformers' matrices; None = bfloat16 where the device multiplies it fast, else float32.

        Raises:
            InvalidBundle: of another model, or damaged.
            InvalidInput: unknown device.
        """
        return cls._of(*open_bundle(bundle, device, threads, dtype))

    @classmethod
    @abstractmethod
    def _of(cls, bundle: Bundle, device: torch.device, dtype: torch.dtype) -> Self:
        """Return the generator of a verified bundle on a device; `dtype` of its transformers' matrices."""

    def settings(self, values: Mapping[str, Any]) -> P:
        """Check an item's settings: numbers that both the model's settings and the bundle's values have.

        Raises:
            InvalidInput: an unknown setting, or a value out of range.
        """
        own = {each.name for each in fields(self.sampling)}
        known = [each.name for each in fields(self.inference) if each.name in own]
        settings = read_settings(self.sampling, values, known)
        settings.inference(self.inference)
        return settings

    def describe_settings(self, settings: P) -> dict[str, Any]:
        """Return all settings that decide how tokens are drawn: the bundle's, with these changes."""
        return asdict(settings.inference(self.inference))


class GroupedGenerator(SampledGenerator[P], Generic[P, G]):
    """A generator that knows lengths beforehand, and draws motions of one bucket of lengths in one pass."""

    def __init__(
        self,
        bundle: Bundle,
        limits: Limits,
        inference: DataclassInstance,
        tokenizer: MotionTokenizer,
        device: torch.device,
        dtype: torch.dtype,
        batch_threads: BatchThreads,
    ) -> None:
        self.bundle = bundle
        self.layout: FeatureLayout = layout_of(bundle.manifest)
        self.limits = limits
        self.inference = inference
        self.tokenizer = tokenizer
        self.device = device
        self.dtype = dtype
        self.batch = MAX_ROWS
        self.batch_threads = batch_threads

    @property
    def frames_per_token(self) -> int:
        """Return N/n, the frames of a token; where a model has several scales, of the finest."""
        return self.tokenizer.frames_per_token

    @abstractmethod
    def _estimate(self, request: Request) -> int:
        """Return the frames of a request that names no length, drawn with its seed."""

    @abstractmethod
    def _drawing(self, requests: Sequence[Request], frames: Sequence[int], settings: P) -> tuple[int, Draw[G]]:
        """Prepare the drawing of motions of these numbers of frames.

        Returns:
            the steps of a group, the last of which is counted when it is drawn, and the function that draws a group.
        """

    def _bucket(self, frames: int) -> int:
        """Return the tokens of a length, rounded up to its bucket."""
        return to_bucket(self._tokens(frames))

    def _tokens(self, frames: int) -> int:
        """Return the tokens that a length takes."""
        return -(-frames // self.frames_per_token)

    def _sentence(self, request: Request) -> Tensor:
        """Return the feature (1, W) of the whole prompt."""
        return torch.from_numpy(request.text.sentence[None].astype(np.float32)).to(self.device)

    def frames(self, request: Request) -> int:
        """Return the feature frames: as requested, or drawn with the request's seed.

        Raises:
            InvalidInput: as `Limits.check`.
        """
        self.limits.check(request)
        if request.frames is not None:
            return request.frames
        with torch.inference_mode():
            return self._estimate(request)

    def resolve_length(self, request: Request) -> Request:
        """Return the request with a length; a missing one is drawn with the request's seed."""
        return replace(request, frames=self.frames(request))

    def bucket(self, request: Request) -> int:
        """Return the tokens rounded up to the bucket; items of one bucket share a forward pass."""
        return self._bucket(self.frames(request))

    @torch.inference_mode()
    def generate(
        self, requests: Sequence[Request], settings: P | None = None, *, control: GenerationControl | None = None
    ) -> list[G | None]:
        """Generate one motion per request, in groups of one bucket on the batch threads; None where `control` dropped
        it.

        The tokens of an item do not depend on the number or order of the others.

        Raises:
            InvalidInput: a length or seed out of range, or features of another encoder.
        """
        frames = [self.frames(request) for request in requests]
        steps, draw = self._drawing(requests, frames, settings or self.sampling())
        results: list[G | None] = [None] * len(frames)
        groups = group_rows([self._bucket(count) for count in frames], self.batch_threads.count)
        counter = StepCounter(control or NoControl(), len(groups) * steps)

        def make(rows: list[int]) -> None:
            watcher = RowWatcher(counter, rows)
            if not watcher.rows:
                return
            drawn = draw(watcher)
            for row, motion in zip(watcher.rows, drawn, strict=True):
                results[row] = motion
            if watcher.rows:
                watcher.step()

        with self.batch_threads.open():
            self.batch_threads.map(make, groups)
        return results
