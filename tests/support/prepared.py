"""A prepared folder of swinging stick figures with made-up text features: small, but in the real format."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch

from marey.bundles import TextSpec
from marey.core.hashing import sha256_of
from marey.data import manifest as names
from marey.data.manifest import Clip, FileEntry, Manifest, Measured, SourceEntry
from marey.data.pack import split_root
from marey.motion.features import HUMANML3D_263
from marey.motion.kinematics import forward_kinematics
from marey.motion.skeleton import HUMANML3D
from marey.text.features import TextFeatures
from marey.text.graph import Edge, Node, SemanticGraph
from marey.training.texts import CaptionTexts

WIDTH = 384


def swinging(frames: int, seed: int) -> np.ndarray:
    """Joints (frames, 22, 3) of a figure that walks forward while every joint swings."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 20
    angle = 0.3 * np.sin(2 * np.pi * time[:, None] * rng.uniform(0.5, 2, 22) + rng.uniform(0, 6, 22))
    rotations = np.zeros((frames, 22, 4))
    rotations[..., 0], rotations[..., 1] = np.cos(angle / 2), np.sin(angle / 2)
    root = np.stack([0 * time, 0.9 + 0 * time, time * rng.uniform(0, 1.5)], -1)
    return forward_kinematics(HUMANML3D, rotations, root)


def farthest_move(before: Mapping[str, torch.Tensor], after: Mapping[str, torch.Tensor]) -> float:
    """How far the weight that training moved most went, but for codes, which tiny batches reset when they are dead."""
    names = [name for name in before if not name.startswith("quantizer.")]
    return max(float((after[name].float() - before[name].float()).abs().max()) for name in names)


def graph(actions: int, specifics: int) -> SemanticGraph:
    """A graph with so many actions and specifics, the latter dealt out to the former."""
    nodes = [Node(0, "motion", "a person moves", (0, 1, 2))]
    nodes += [Node(1 + a, "action", "moves", (2,)) for a in range(actions)]
    nodes += [Node(1 + actions + s, "specific", "a person", (0, 1)) for s in range(specifics)]
    edges = [Edge(0, 1 + a, "MA", "MA") for a in range(actions)]
    edges += [Edge(1 + s % actions, 1 + actions + s, "ARG0", "ARG0") for s in range(specifics)]
    return SemanticGraph("a person moves", ("a", "person", "moves"), tuple(nodes), tuple(edges))


def text_features(seed: int, actions: int = 2, specifics: int = 3, width: int = WIDTH) -> TextFeatures:
    """Features of a made-up prompt; `specifics` is 0 where there are no actions."""
    specifics = specifics if actions else 0
    vectors = np.random.default_rng(seed).normal(size=(1 + actions + specifics, width)) / 20
    return TextFeatures("a person moves", "a person moves", graph(actions, specifics), vectors.astype(np.float16))


def write_prepared(folder: Path, clips: int = 18, acts: Sequence[str] = ()) -> Path:
    """Write a prepared folder with texts.

    With `acts`, clip i does one of them, i modulo their number: it swings in that act's way, and its captions name it.
    """
    folder.mkdir(parents=True)
    seeds = [i % len(acts) if acts else i for i in range(clips)]
    motions = [HUMANML3D_263.canonicalize(swinging(36 + 9 * (i % 8), seed)) for i, seed in enumerate(seeds)]
    features = [HUMANML3D_263.encode(joints) for joints in motions]
    starts = np.concatenate([[0], np.cumsum([len(f) for f in features])])
    lines = [_clip(i, int(starts[i]), len(f), acts) for i, f in enumerate(features)]
    (folder / names.CLIPS).write_text("".join(c.model_dump_json() + "\n" for c in lines), encoding="utf-8")
    whole = np.concatenate(features).astype(np.float32)
    std = whole.std(0)
    for group in HUMANML3D_263.slices.values():
        std[group] = max(float(std[group].mean()), 1e-3)
    np.save(folder / names.FEATURES, whole)
    local, roots = split_root(np.concatenate(motions))
    np.save(folder / names.JOINTS, local)
    np.save(folder / names.ROOTS, roots)
    np.savez(folder / names.STATISTICS, mean=whole.mean(0), std=std)
    manifest = _manifest(folder, clips, len(whole))
    (folder / names.MANIFEST).write_text(json.dumps(manifest.model_dump(mode="json")), encoding="utf-8")
    made_up_texts([4 if joined(i) and not acts else 2 for i in range(clips)]).save(folder)
    return folder


def _clip(number: int, start: int, length: int, acts: Sequence[str]) -> Clip:
    act = acts[number % len(acts)] if acts else None
    two = joined(number) and act is None
    return Clip(
        id=f"clip{number}",
        start=start,
        length=length,
        joints_start=start + number,
        split=("train", "train", "train", "train", "val", "test")[number % 6],
        dataset="synthetic",
        content=act or ("walk" if number % 3 else "run"),
        style="normal",
        mirrored=False,
        spliced=(),
        acts=(act,) if act else ("walk", "bow") if two else ("walk",),
        sides=("", "") if two else ("",),
        measured=Measured(seconds=1, path=1, turn=0, speed=1, steps=1, side=""),
        captions=(f"a person does {act}", act) if act else ("one", "two"),
        seams=(20,) if two else (),
        act_captions=("three", "four") if two else (),
    )


def _manifest(folder: Path, clips: int, frames: int) -> Manifest:
    files = {n: FileEntry(sha256=sha256_of(folder / n), bytes=(folder / n).stat().st_size) for n in names.FILES}
    source = SourceEntry(
        name="synthetic", title="-", licence="MIT", credit="-", url="-", tier="commercial", clips=clips
    )
    return Manifest(
        format=names.FORMAT, sources=(source,), tier="commercial",
        layout="humanml3d-263", facing_sigma=20, fps=20, skeleton="humanml3d",
        dim=263, frames=frames, clips=clips, splits={}, lengths={}, kinds={}, captions=2, left_out={},
        compositional_pairs=(), files=files,
    )  # fmt: skip


def joined(clip: int) -> bool:
    """Which clips have a seam."""
    return clip % 5 == 1


def made_up_texts(counts: Sequence[int]) -> CaptionTexts:
    """Texts of so many captions a clip, with 0 to 3 actions."""
    captions = sum(counts)
    graphs = [graph(i % 4, (i % 4 > 0) * (i % 5)) for i in range(captions)]
    nodes = [len(g.nodes) for g in graphs]
    rng = np.random.default_rng(0)
    return CaptionTexts(
        TextSpec(),
        (rng.normal(size=(40, WIDTH)) / 20).astype(np.float16),
        np.concatenate([[0], np.cumsum(counts)]),
        np.concatenate([[0], np.cumsum(nodes)]),
        rng.integers(40, size=sum(nodes)).astype(np.int32),
        np.array([("motion", "action", "specific").index(n.level) for g in graphs for n in g.nodes], np.int8),
        np.concatenate([[0], np.cumsum([len(g.edges) for g in graphs])]),
        np.array([(e.source, e.target, 11 if e.type == "MA" else 0) for g in graphs for e in g.edges], np.int16),
    )
