"""Load the two networks of an evaluator bundle; shared by all kinds of evaluators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Generic, Protocol, TypeVar

import torch
from torch import nn

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle
from marey.nn.bundling import fill

KIND = "evaluator"


class Readable(Protocol):
    """A configuration with the layout of motions and the width of embeddings."""

    @property
    def layout(self) -> str: ...
    @property
    def fps(self) -> float: ...
    @property
    def width(self) -> int: ...


C = TypeVar("C", bound=Readable)
M = TypeVar("M", bound=nn.Module)
T = TypeVar("T", bound=nn.Module)


class LoadedNetworks(Generic[C, M, T]):
    """The parts of `Evaluator` that a bundle determines, with its two encoders on their device."""

    def __init__(self, bundle: Bundle, config: C, motion: M, text: T, device: torch.device) -> None:
        """Move the encoders to the device."""
        self.bundle, self.config, self.device = bundle, config, device
        self.motion, self.text = motion.to(device), text.to(device)

    @property
    def name(self) -> str:
        """See `Evaluator`."""
        return self.bundle.reference

    @property
    def layout(self) -> str:
        """See `Evaluator`."""
        return self.config.layout

    @property
    def fps(self) -> float:
        """See `Evaluator`."""
        return self.config.fps

    @property
    def width(self) -> int:
        """See `Evaluator`."""
        return self.config.width


def open_networks(
    bundle: Bundle,
    model: str,
    read: Callable[[Mapping[str, Any]], C],
    motion: Callable[[C], M],
    text: Callable[[C], T],
) -> tuple[C, M, T]:
    """Build and fill the encoders of a bundle, float32, in evaluation mode.

    Args:
        bundle: a verified bundle.
        model: required model of the bundle.
        read: parses its configuration.
        motion: builds the motion encoder, whose `mean` and `std` are the bundle's statistics.
        text: builds the text encoder.

    Raises:
        InvalidBundle: of another kind, model or layout, or its tensors do not fit its configuration.
    """
    manifest = bundle.manifest
    if (manifest.kind, manifest.model) != (KIND, model):
        raise InvalidBundle(
            f"is a {manifest.kind} of {manifest.model}, not an {KIND} of {model}", where=str(bundle.path)
        )
    config = read(manifest.parameters)
    if (manifest.layout, manifest.fps) != (config.layout, config.fps):
        raise InvalidBundle(f"its networks read {config.layout}, not {manifest.layout}", where=str(bundle.path))
    encoders = motion(config), text(config)
    for encoder, part in zip(encoders, ("motion", "text"), strict=True):
        fill(encoder, bundle, part)
    _set_statistics(encoders[0], bundle)
    return config, *encoders


def _set_statistics(motion: nn.Module, bundle: Bundle) -> None:
    known = (motion.get_buffer("mean"), motion.get_buffer("std"))
    given = tuple(torch.from_numpy(values) for values in bundle.statistics())
    if [each.shape for each in given] != [each.shape for each in known]:
        raise InvalidBundle(f"statistics have shape {tuple(given[0].shape)}", where=str(bundle.path))
    for buffer, values in zip(known, given, strict=True):
        buffer.copy_(values)
