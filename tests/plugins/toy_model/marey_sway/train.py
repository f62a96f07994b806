"""Train Sway: one stage, then the bundle."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor, nn

from marey.bundles import Bundle, TextSpec
from marey.core.errors import InvalidInput
from marey.nn.bundling import standing, write_generator
from marey.training.assembly import gather
from marey.training.motions import MotionData
from marey.training.staging import TrainingRecipe, TrainOptions, finish
from marey_sway.config import SwayConfig

RECIPE = TrainingRecipe(read=SwayConfig.from_dict, built_from={"pose": ("layout",)}, shares={"pose": 1.0})


class Pose(nn.Module):
    """The one tensor of a bundle: a frame of features."""

    def __init__(self, mean: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)


def named_config(name: str, *, side: str | None = None) -> SwayConfig:
    """A configuration by name.

    Raises:
        InvalidInput: no such configuration.
    """
    if name != "starter":
        raise InvalidInput(f"unknown configuration {name!r}", hint="Known: starter.")
    return SwayConfig() if side is None else replace(SwayConfig(), side=side)


def train_stage(name: str, options: TrainOptions[SwayConfig]) -> dict[str, float]:
    """Average the frames of the prepared clips; return the height of the root."""
    RECIPE.check_name(name)
    data = MotionData.load(options.prepared, torch.device("cpu"))
    metrics = {"height": float(data.mean[3])}
    finish(Pose(data.mean), options, name, metrics, data.prepared.sha256)
    return metrics


def assemble(
    prepared: Path, run: Path, bundle: Path, config: SwayConfig, *, card: str | None = None, overwrite: bool = False
) -> Bundle:
    """Write the bundle from the part of a run."""
    gathered = gather(prepared, run, RECIPE, config)
    return _write(
        bundle, config, gathered.parts["pose"].state, card, overwrite, text=gathered.text, **gathered.manifest
    )


def random_bundle(path: Path) -> Bundle:
    """Write a bundle that was never trained: the rest pose."""
    mean = torch.from_numpy(standing(SwayConfig().layout)[0])
    return _write(path, SwayConfig(), {"mean": mean}, None, True, text=TextSpec(), random=True, licence="MIT")


def _write(path: Path, config: SwayConfig, state: dict[str, Tensor], card: str | None, overwrite: bool, **manifest):
    return write_generator(
        path, "sway", config, {"pose": {"frame": state["mean"]}}, standing(config.layout),
        card=card, overwrite=overwrite, **manifest,
    )  # fmt: skip
