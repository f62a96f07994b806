"""Checkpoints that resume exactly: safetensors and JSON, written atomically; never a pickle."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from marey.core.documents import read_json
from marey.core.errors import InvalidFile, NotFound
from marey.nn.ema import WeightAverage

FORMAT = 1


@dataclass(frozen=True)
class TrainingState:
    """Position of a run. Random numbers and data order are functions of (seed, step, rank), so they need no state."""

    stage: str
    step: int
    seconds: float
    seed: int
    config: dict[str, Any]
    metrics: dict[str, float]
    format: int = FORMAT


def save_checkpoint(
    folder: Path, state: TrainingState, module: nn.Module, average: WeightAverage, optimizer: torch.optim.Optimizer
) -> None:
    """Replace `folder`; a crash in between keeps the previous checkpoint."""
    temporary = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    _save(temporary / "model.safetensors", module.state_dict())
    _save(temporary / "average.safetensors", average.values)
    _save(temporary / "optimizer.safetensors", _flatten_optimizer(optimizer))
    (temporary / "state.json").write_text(json.dumps(asdict(state), indent=1), encoding="utf-8")
    old = folder.with_name(f".{folder.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if folder.exists():
        folder.rename(old)
    temporary.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def restore_previous(folder: Path) -> None:
    """Bring back the previous checkpoint where a run was killed while it replaced it; one process does so for all."""
    old = folder.with_name(f".{folder.name}.old")
    if not (folder / "state.json").is_file() and (old / "state.json").is_file():
        old.rename(folder)


def read_state(folder: Path) -> TrainingState:
    """Read the JSON half of a checkpoint.

    Raises:
        NotFound: it does not exist.
        InvalidFile: it is damaged, or of another version.
    """
    file = folder / "state.json"
    if not file.is_file():
        raise NotFound("there is no checkpoint", where=str(folder), hint="Start the run without --resume.")
    try:
        state = TrainingState(**read_json(file, allow_nan=True))
    except TypeError as error:
        raise InvalidFile(f"is not a checkpoint's state: {error}", where=str(file)) from error
    if state.format != FORMAT:
        raise InvalidFile(f"has format {state.format}; this version reads {FORMAT}", where=str(file))
    return state


def load_checkpoint(
    folder: Path, module: nn.Module, average: WeightAverage, optimizer: torch.optim.Optimizer
) -> TrainingState:
    """Restore everything in place and return the state."""
    state = read_state(folder)
    try:
        module.load_state_dict(load_file(folder / "model.safetensors"))
        average.load(load_file(folder / "average.safetensors"))
        _restore_optimizer(optimizer, load_file(folder / "optimizer.safetensors"))
    except (SafetensorError, RuntimeError, KeyError, ValueError, OSError) as error:
        raise InvalidFile(f"the checkpoint does not fit this run: {error}", where=str(folder)) from error
    return state


def _save(file: Path, tensors: dict[str, Tensor]) -> None:
    save_file({name: value.detach().cpu().contiguous().clone() for name, value in tensors.items()}, file)


def _flatten_optimizer(optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """Return AdamW's state as `{parameter index}.{exp_avg|exp_avg_sq|step}`."""
    state = optimizer.state_dict()["state"]
    return {f"{index}.{name}": value for index, entry in state.items() for name, value in entry.items()}


def _restore_optimizer(optimizer: torch.optim.Optimizer, tensors: dict[str, Tensor]) -> None:
    state: dict[int, dict[str, Tensor]] = {}
    for key, value in tensors.items():
        index, _, name = key.partition(".")
        state.setdefault(int(index), {})[name] = value
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
