"""A folder as the public download unpacks: names, options, wrappers and shapes, with weights of any size."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from tests.models.momask.public import (
    FULL,
    Sizes,
    length_shapes,
    masked_shapes,
    residual_shapes,
    rvq_shapes,
    weights,
)

RVQ = "rvq_nq6_dc512_nc512_noshare_qdp0.2"
MASKED = "t2m_nlayer8_nhead6_ld384_ff1024_cdp0.1_rvq6ns"
RESIDUAL = "tres_nlayer8_ld384_ff1024_rvq6ns_cdp0.2_sw"
FEATURES = {"t2m": 263, "kit": 251}


def write_options(file: Path, values: Mapping[str, Any]) -> None:
    """Write an opt.txt, as the public code prints its options."""
    lines = [f"{key}: {value}" for key, value in sorted(values.items())]
    text = ["------------ Options -------------", *lines, "-------------- End ----------------", ""]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(text))


def save(file: Path, **entries: Any) -> None:
    """Write a checkpoint with the entries that training leaves beside the weights."""
    file.parent.mkdir(parents=True, exist_ok=True)
    torch.save({"ep": 3, "total_it": 12, **entries}, file)


def vq_options(sizes: Sizes, data_set: str = "t2m", **changes: Any) -> dict[str, Any]:
    options = {
        "batch_size": 256, "checkpoints_dir": "./checkpoints", "code_dim": sizes.code_width, "commit": 0.02,
        "dataset_name": data_set, "depth": sizes.depth, "dilation_growth_rate": 3, "down_t": 2, "feat_bias": 5,
        "gamma": 0.05, "is_continue": False, "lr": 0.0002, "milestones": [150000, 250000], "mu": 0.99, "name": RVQ,
        "nb_code": sizes.codes, "num_quantizers": sizes.levels, "output_emb_width": sizes.code_width,
        "quantize_dropout_prob": 0.2, "shared_codebook": False, "stride_t": 2, "vq_act": "relu", "vq_name": RVQ,
        "vq_norm": None, "weight_decay": 0.0, "which_epoch": "all", "width": sizes.width, "window_size": 64,
    }  # fmt: skip
    return options | changes


def transformer_options(sizes: Sizes, data_set: str = "t2m", **changes: Any) -> dict[str, Any]:
    options = {
        "batch_size": 64, "checkpoints_dir": "./checkpoints", "cond_drop_prob": 0.1, "dataset_name": data_set,
        "dropout": 0.2, "ff_size": sizes.feedforward, "force_mask": False, "gpu_id": 0, "latent_dim": sizes.latent,
        "lr": 0.0002, "max_motion_length": 196, "milestones": [50000], "n_heads": sizes.heads,
        "n_layers": sizes.layers, "name": MASKED, "share_weight": False, "unit_length": 4, "vq_name": RVQ,
    }  # fmt: skip
    return options | changes


def write_download(
    root: Path, sizes: Sizes = FULL, *, data_set: str = "t2m", shared: bool = True, salt: str = ""
) -> Path:
    """Write `checkpoints/t2m` or `checkpoints/kit` below `root`, and return that folder."""
    folder = root / "checkpoints" / data_set
    rvq, masked, residual = (folder / (name + ("_k" if data_set == "kit" else "")) for name in (RVQ, MASKED, RESIDUAL))
    names = {"vq_name": rvq.name}
    write_options(rvq / "opt.txt", vq_options(sizes, data_set, name=rvq.name))
    write_options(masked / "opt.txt", transformer_options(sizes, data_set, name=masked.name, **names))
    options = transformer_options(sizes, data_set, name=residual.name, share_weight=shared, **names)
    write_options(residual / "opt.txt", options)
    tensors = weights(rvq_shapes(sizes), salt)
    save(rvq / "model" / "net_best_fid.tar", vq_model=tensors, opt_vq_model={"state": {0: tensors}}, scheduler={})
    statistics = np.random.RandomState(0)
    (rvq / "meta").mkdir()
    np.save(rvq / "meta" / "mean.npy", statistics.normal(size=FEATURES[data_set]).astype(np.float32) / 50)
    np.save(rvq / "meta" / "std.npy", statistics.uniform(0.02, 0.1, FEATURES[data_set]).astype(np.float32))
    tensors = weights(masked_shapes(sizes), salt)
    save(masked / "model" / "latest.tar", t2m_transformer=tensors, opt_t2m_transformer={"state": {0: tensors}})
    save(residual / "model" / "net_best_fid.tar", res_transformer=weights(residual_shapes(sizes, shared=shared), salt))
    save(
        folder / "length_estimator" / "model" / "finest.tar", estimator=weights(length_shapes(), salt), epoch=1, niter=2
    )
    return folder
