"""A tiny folder in the layout of SnapMoGen's publication, of our own motions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from marey.motion.rig_features import SNAPMOGEN_296
from tests.support.rigged import mirrored, rigged

FRAMES = 301
SPLITS = {
    "train": ("gp_00001#0#150", "m_gp_00001#0#150", "st2_00002#30#210"),
    "val": ("gp_00001#150#300",),
    "test": ("ep_00003#0#120",),
}


def write_folder(path: Path) -> Path:
    """Write the folder; return its path."""
    for name in ("renamed_feats", "meta_data", "data_split_info"):
        (path / name).mkdir(parents=True)
    every = []
    for seed, mid in enumerate(("gp_00001", "st2_00002", "ep_00003")):
        motion = rigged(seed, FRAMES, turns=0.1 * seed)
        every.append(SNAPMOGEN_296.encode_pose(*motion))
        np.save(path / "renamed_feats" / f"{mid}.npy", every[-1])
        np.save(path / "renamed_feats" / f"m_{mid}.npy", SNAPMOGEN_296.encode_pose(*mirrored(*motion)))
    frames = np.concatenate(every).astype(np.float64)
    np.save(path / "meta_data" / "mean.npy", frames.mean(axis=0))
    np.save(path / "meta_data" / "std.npy", frames.std(axis=0))
    captions = {}
    for split, names in SPLITS.items():
        (path / "data_split_info" / f"{split}_ids.txt").write_text("\n".join(names) + "\n")
        mids = sorted({name.split("#")[0] for name in names})
        (path / "data_split_info" / f"{split}_fnames.txt").write_text("\n".join(mids) + "\n")
        for name in names:
            if not name.startswith("m_"):
                captions[name] = {
                    "manual": [f"The person sways to the left in take {name}.", "A figure  walks."],
                    "gpt": [f"Version {k} of {name}." for k in range(4)],
                }
    (path / "all_caption_clean.json").write_text(json.dumps(captions))
    return path
