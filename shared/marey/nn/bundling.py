"""Write a generator's networks into a bundle, and load a bundle's tensors into networks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.bundles import Bundle, BundleWriter, TextSpec
from marey.bundles.eight_bit import restore
from marey.core.errors import InvalidBundle
from marey.motion.features import layout
from marey.nn.motion_tokenizer import MotionTokenizer, biased_std

NOT_STORED = frozenset({"quantizer.sums", "mean", "std"})
"""Tensors of a tokenizer: state of the codebooks' training, as large as the codebooks; and the bundle's statistics."""
ASKED_IN_TRAINING = "ahead."
"""Tensors of a transformer: heads for frames further ahead, used in training alone."""


def stored(name: str) -> bool:
    """Return True if a bundle keeps a tensor of this name: it is needed for inference."""
    return name not in NOT_STORED and not name.startswith(ASKED_IN_TRAINING)


class GeneratorConfig(Protocol):
    """Fields of a generator's configuration that go into the manifest."""

    @property
    def name(self) -> str: ...
    @property
    def layout(self) -> str: ...
    @property
    def fps(self) -> float: ...
    def to_dict(self) -> dict[str, Any]: ...


def write_generator(
    path: Path,
    model: str,
    config: GeneratorConfig,
    parts: Mapping[str, Mapping[str, Tensor]],
    statistics: tuple[NDArray[np.float32], NDArray[np.float32]],
    *,
    text: TextSpec,
    card: str | None = None,
    overwrite: bool = False,
    dtype: type[np.floating] = np.float16,
    **manifest: Any,
) -> Bundle:
    """Write a bundle from the parts' state dicts.

    Args:
        path: the bundle's folder; its last name is the bundle's.
        model: name of the model that reads it.
        config: configuration of the networks.
        parts: state dict of each part; those of the codebooks' training are left out.
        statistics: mean and std (D,) that the tokenizer normalises with.
        text: encoder, labeller and caps.
        card: the model card.
        overwrite: replace an existing bundle.
        dtype: of the stored tensors; imported weights are kept in float32, so that published figures can be repeated.
        manifest: licence, data, metrics, training, random, version.
    """
    skeleton = layout(config.layout).skeleton  # of the prepared data, whose every clip has these bones
    with BundleWriter(path, overwrite=overwrite) as writer:
        for name, state in parts.items():
            writer.add_part(name, {k: v.cpu().numpy() for k, v in state.items() if stored(k)}, dtype=dtype)
        writer.add_statistics(*statistics)
        if card is not None:
            writer.add_card(card)
        return writer.finish(
            name=path.name,
            kind="generator",
            model=model,
            config=config.name,
            parameters=config.to_dict(),
            skeleton=skeleton.name,
            offsets=(skeleton.offsets.astype(np.float64).round(6) + 0.0).tolist(),
            layout=config.layout,
            fps=config.fps,
            text=text,
            **{"version": "1", **manifest},
        )


@dataclass(frozen=True)
class NetworkParts:
    """Base class of the networks of a generator's bundle, a field each; None = its configuration has no such part."""

    tokenizer: MotionTokenizer

    def parts(self) -> dict[str, nn.Module]:
        """Return the networks by part name."""
        found = {each.name: getattr(self, each.name) for each in fields(self)}
        return {name: network for name, network in found.items() if network is not None}

    def states(self) -> dict[str, dict[str, Tensor]]:
        """Return the state dicts of the networks by part name."""
        return {name: network.state_dict() for name, network in self.parts().items()}

    def to(self, device: torch.device) -> None:
        """Move the networks to a device."""
        for network in self.parts().values():
            network.to(device)

    def fill(self, bundle: Bundle) -> None:
        """Load the parts of a bundle into the networks (see `fill`), and its statistics into the tokenizer.

        Raises:
            InvalidBundle: the tensors do not fit a network.
        """
        for name, network in self.parts().items():
            fill(network, bundle, name)
        self.tokenizer.set_statistics(*(torch.tensor(values) for values in bundle.statistics()))


C = TypeVar("C")
N = TypeVar("N", bound=NetworkParts)


def load_parts(
    bundle: Bundle, model: str, read: Callable[[Mapping[str, Any]], C], build: Callable[[C], N]
) -> tuple[C, N]:
    """Build and fill the networks of a generator's bundle, float32, in evaluation mode.

    Args:
        bundle: verified.
        model: required model of the bundle.
        read: parses its configuration.
        build: makes the networks of a configuration.

    Raises:
        InvalidBundle: of another model, or its tensors do not fit its configuration.
    """
    if bundle.manifest.model != model:
        raise InvalidBundle(f"a bundle of model {bundle.manifest.model}, not {model}", where=str(bundle.path))
    config = read(bundle.manifest.parameters)
    networks = build(config)
    networks.fill(bundle)
    return config, networks


def fill(network: nn.Module, bundle: Bundle, part: str) -> None:
    """Load a part into its network in place and switch the network to evaluation mode.

    Args:
        network: built from the bundle's configuration.
        bundle: verified.
        part: name of the part.

    Raises:
        InvalidBundle: the tensors do not fit the network.
    """
    where = f"{bundle.path}: {part}"
    state = {name: torch.tensor(value) for name, value in restore(bundle.tensors(part), where=where).items()}
    try:
        found: Any = network.load_state_dict(state, strict=False)
    except RuntimeError as error:  # a shape differs
        raise InvalidBundle(f"tensors do not fit the configuration: {error}", where=where) from error
    missing: list[str] = sorted(name for name in found.missing_keys if stored(name))
    unknown: list[str] = sorted(found.unexpected_keys)
    if missing or unknown:
        raise InvalidBundle(
            f"tensors do not fit the configuration: missing {missing[:3]}, unknown {unknown[:3]}", where=where
        )
    network.eval().requires_grad_(False)


G = TypeVar("G", bound=GeneratorConfig)


def write_random(
    path: Path | str,
    model: str,
    config: G,
    build: Callable[[G], NetworkParts],
    loud: Collection[str],
    seed: int,
    *,
    text: TextSpec,
    bias: float = 1.0,
    dtype: type[np.floating] = np.float16,
) -> Bundle:
    """Write a bundle with random weights, for tests: it runs like a trained one (manifest `random` = true).

    Statistics are those of a person standing still, so that joints stay within a sane range.

    Args:
        path: the bundle's folder, which is replaced.
        model: name of the model that reads it.
        config: configuration of the networks.
        build: makes the networks of a configuration; their codebooks are drawn as well.
        loud: parts whose matrices are scaled up from their initial values, so that prompts make a difference.
        seed: torch's own generator is not changed.
        text: encoder, labeller and caps.
        bias: of root and contacts in the statistics (`biased_std`).
        dtype: of the stored tensors.
    """
    with torch.random.fork_rng(devices=[]):  # pyright: ignore[reportUnknownMemberType]
        torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
        networks = build(config)
        quantizer: Any = networks.tokenizer.quantizer
        quantizer.codebooks.normal_()
        quantizer.initialized.fill_(True)
        for layer in (layer for name in loud for layer in networks.parts()[name].modules()):
            if isinstance(layer, nn.Linear):
                nn.init.normal_(layer.weight, std=0.1)
    mean, std = standing(config.layout)
    statistics = mean, biased_std(torch.tensor(std), bias).numpy()
    return write_generator(
        Path(path), model, config, networks.states(), statistics,
        text=text, dtype=dtype, random=True, licence="MIT", overwrite=True,
    )  # fmt: skip


def standing(name: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return mean and std (D,) of a layout's features around the rest pose: statistics for random weights."""
    features = layout(name)
    rest = features.skeleton.offsets.astype(np.float64).copy()
    for joint, parent in enumerate(features.skeleton.parents):
        if parent >= 0:
            rest[joint] += rest[parent]
    rest[:, 1] -= rest[:, 1].min()
    mean = features.encode(np.repeat(rest[None], 3, 0))[0]
    std = np.full(features.dim, 0.05, np.float32)
    std[:4] = 0.01
    return mean.astype(np.float32), std
