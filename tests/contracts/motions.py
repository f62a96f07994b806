"""Motions of the shipped bundles: the same prompt and seed give the same tokens and files, release after release."""

from __future__ import annotations

import hashlib
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from marey.bundles import Bundle
from marey.core.settings import Settings

MODELS = Path(__file__).resolve().parents[2] / "models"
PROMPT, SEED, SECONDS = "a person walks forward and waves with the right hand", 5, 2.0


def processor() -> str:
    """The features that decide the order in which a matrix product is summed: only equal machines give equal bits.

    Two generations of a vendor with the same flags differ, so the family and the model are part of it, and the kernels
    that numpy's OpenBLAS is told to use.
    """
    lines = (line.partition(":") for line in Path("/proc/cpuinfo").read_text().splitlines())
    first: dict[str, str] = {}
    for name, _, value in lines:
        first.setdefault(name.strip(), value.strip())
    known = [flag for flag in ("avx2", "avx512f", "avx512_bf16", "amx_bf16") if flag in first["flags"].split()]
    kind = [first.get(name, "") for name in ("vendor_id", "cpu family", "model")]
    told = [f"OpenBLAS {name}"] if (name := os.environ.get("OPENBLAS_CORETYPE")) else []
    return " ".join([*kind, *known, *told, f"torch {torch.__version__.partition('+')[0]}"])


def motion(name: str) -> dict[str, Any]:
    """Joints of one motion, the hashes of its npz (without the manifest) and BVH, and the keys of the manifest."""
    from marey.generate.oneshot import OneShot, Wanted
    from marey.motion.io.bvh import format_bvh

    torch.set_num_threads(1)
    studio = OneShot(Bundle.open(MODELS / name), Settings(device="cpu", threads=1))
    ((_, clip, _),) = studio.make([Wanted(PROMPT, SEED, SECONDS, {})])
    return {
        "frames": clip.frames,
        "joints": np.round(clip.joints[:: max(clip.frames // 8, 1)], 3).tolist(),
        "npz": hashlib.sha256(replace(clip, manifest={}).to_npz()).hexdigest(),
        "bvh": hashlib.sha256(format_bvh(clip).encode()).hexdigest(),
        "manifest": sorted(clip.manifest),
    }
