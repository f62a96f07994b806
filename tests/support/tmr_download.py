"""A download of TMR (Petrovich et al. 2023) as its repository lays it out, with random numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch

from tests.unit.evaluator.published import actor_shapes, drawn, state_of

NAME = "tmr_humanml3d_guoh3dfeats"
TINY = {"latent_dim": 16, "ff_size": 32, "num_layers": 1, "num_heads": 2}
PUBLISHED = {"latent_dim": 256, "ff_size": 1024, "num_layers": 6, "num_heads": 4}


def write_tmr_download(folder: Path, sizes: dict[str, int] | None = None, *, data: str = "humanml3d") -> Path:
    """Write `models/tmr_*` with configuration and weights, and `stats`; return the folder of the model."""
    sizes = sizes or TINY
    model = folder / "models" / NAME.replace("humanml3d", data)
    (model / "last_weights").mkdir(parents=True)
    (model / "config.json").write_text(json.dumps(config_of(sizes, data), indent=4), encoding="utf-8")
    for name, state in states(sizes).items():
        torch.save(state, model / "last_weights" / f"{name}.pt")
    (model / "contrastive_metrics").mkdir()
    (model / "contrastive_metrics" / "normal.yaml").write_text("t2m/R01: 5.0\n", encoding="utf-8")
    stats = folder / "stats" / data / "guoh3dfeats"
    stats.mkdir(parents=True)
    generator = torch.Generator().manual_seed(3)
    torch.save(torch.randn(263, generator=generator) / 4, stats / "mean.pt")
    torch.save(torch.rand(263, generator=generator) + 0.5, stats / "std.pt")
    return model


def write_training_checkpoint(model: Path, sizes: dict[str, int] | None = None) -> Path:
    """Write the checkpoint that the training leaves, with an optimizer and the state of its callbacks."""
    tables = states(sizes or TINY)
    state = {f"{name}.{key}": value for name, table in tables.items() for key, value in table.items()}
    file = model / "logs" / "checkpoints" / "last.ckpt"
    file.parent.mkdir(parents=True)
    torch.save(
        {
            "epoch": 499,
            "global_step": 1000,
            "pytorch-lightning_version": "2.0.9",
            "state_dict": state,
            "loops": {"fit_loop": {"epoch_progress": {"total": {"ready": 500}}}},
            "callbacks": {"ModelCheckpoint{'monitor': 'step'}": {"current_score": torch.tensor(1.0)}},
            "optimizer_states": [{"state": {0: {"exp_avg": torch.ones(2)}}, "param_groups": [{"lr": 1e-4}]}],
            "lr_schedulers": [],
        },
        file,
    )
    return file


def states(sizes: dict[str, int]) -> dict[str, dict[str, torch.Tensor]]:
    """Tensors of the three networks by their published names; of the decoder, which no import reads, the last map."""
    shapes = (sizes["latent_dim"], sizes["ff_size"], sizes["num_layers"])
    decoder = {"final_layer.weight": (263, sizes["latent_dim"]), "final_layer.bias": (263,)}
    text = {name: drawn(f"text/{name}", shape) for name, shape in actor_shapes(768, *shapes).items()}
    return {
        "motion_encoder": state_of(actor_shapes(263, *shapes)),
        "text_encoder": text,
        "motion_decoder": state_of(decoder),
    }


def config_of(sizes: dict[str, int], data: str) -> dict[str, Any]:
    """The configuration that the training writes, as far as it says what the weights are."""
    encoder = {"_target_": "src.model.ACTORStyleEncoder", "vae": True, **sizes, "dropout": 0.1, "activation": "gelu"}
    return {
        "run_dir": f"outputs/{NAME}",
        "seed": 1234,
        "data": {
            "motion_loader": {
                "_target_": "src.data.motion.AMASSMotionLoader",
                "base_dir": "datasets/motions/guoh3dfeats",
                "normalizer": {"base_dir": f"stats/{data}/guoh3dfeats", "eps": 1e-12},
                "fps": 20.0,
                "nfeats": 263,
            },
            "text_to_token_emb": {"path": f"datasets/annotations/{data}", "modelname": "distilbert-base-uncased"},
            "text_to_sent_emb": {"modelname": "sentence-transformers/all-mpnet-base-v2"},
        },
        "model": {
            "_target_": "src.model.TMR",
            "motion_encoder": {**encoder, "nfeats": 263},
            "text_encoder": {**encoder, "nfeats": 768},
            "motion_decoder": {"_target_": "src.model.ACTORStyleDecoder", "nfeats": 263, **sizes},
            "vae": True,
            "temperature": 0.1,
            "threshold_selfsim": 0.8,
        },
    }
