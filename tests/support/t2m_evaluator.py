"""The files of the public T2M evaluator in small, with random numbers under the public names."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import torch

from marey.evaluator.t2m_model import T2MConfig, T2MMotionEncoder, T2MTextEncoder

SMALL = T2MConfig(movement=12, motion_hidden=10, text_hidden=8, width=6, word_width=5)
VOCABULARY = ["a", "person", "walk", "left", "unk", "sos", "eos", "wave"]


def write_public_files(root: Path, config: T2MConfig = SMALL) -> Path:
    """Write the folders into `root`; return it."""
    torch.manual_seed(0)
    motion, text = T2MMotionEncoder(config), T2MTextEncoder(config)
    weights = {
        "movement_encoder": motion.movement.state_dict(),
        "motion_encoder": motion.motion.state_dict(),
        "text_encoder": text.state_dict(),
        "opt_motion_encoder": torch.optim.Adam(motion.parameters()).state_dict(),
        "epoch": 55,
        "iter": 1000,
    }
    for folder in ("text_mot_match/model", "Comp_v6_KLD005/meta", "glove"):
        (root / folder).mkdir(parents=True)
    torch.save(weights, root / "text_mot_match" / "model" / "finest.tar")
    rng = np.random.default_rng(0)
    np.save(root / "Comp_v6_KLD005" / "meta" / "mean.npy", rng.normal(size=config.features))
    np.save(root / "Comp_v6_KLD005" / "meta" / "std.npy", rng.uniform(0.5, 2, config.features))
    np.save(root / "glove" / "our_vab_data.npy", rng.normal(size=(len(VOCABULARY) + 3, config.word_width)))
    (root / "glove" / "our_vab_words.pkl").write_bytes(pickle.dumps(VOCABULARY))
    index = {word: len(VOCABULARY) + 2 - row for row, word in enumerate(VOCABULARY)}
    (root / "glove" / "our_vab_idx.pkl").write_bytes(pickle.dumps(index))
    return root
