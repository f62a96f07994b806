"""Loops of walks, runs and idles, generated and captured: how many pass the bars, and why the others are refused.

Captured clips come from the sets under `open-motions/commercial` in MAREY_DATA, by the actions in their indices;
generated ones are made by `hgm3-open` here. Every loop is played three times by `concat`, and measured from the played
file alone.
"""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput, NotFound
from marey.data.archive import bvh_files
from marey.data.prepare import CaptureSet, retarget_file
from marey.generate import load
from marey.motion import MotionClip, edit
from marey.motion.arrange import placement_of
from marey.motion.edits.loop import STILL
from marey.motion.edits.loop_feet import standing_spans, supports
from marey.motion.edits.loop_search import has_steps
from marey.motion.feet import find_contacts, runs, skate
from marey.motion.pose import solve_pose
from marey.motion.rotations import rotate
from marey.motion.skeleton import HUMANML3D

SETS = ("cmu", "g1_moves", "quaternius_ual1", "quaternius_people2019", "kaykit_medium", "mesh2motion_addon")
KINDS = {"walk": "a person walks forward", "run": "a person runs forward", "idle": "a person stands idle"}
SHORTEST, LONGEST = {"walk": 1.5, "run": 1.2, "idle": 2.5}, 20.0
"""Seconds of captured clips; most captured runs have four steps."""
FPS = 20.0
EACH = {"captured": 34, "generated": 33}
"""Clips of a kind."""
BAR = 0.95


def main() -> None:
    """Print the outcomes by kind and source, and the reasons of refusals."""
    outcomes: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    reasons: list[str] = []
    for origin, kind, name, clip in [*captured(), *generated()]:
        outcome = measured(clip)
        outcomes[origin, kind][outcome.split(":")[0]] += 1
        if outcome != "passed":
            reasons.append(f"- {origin} {kind}, {name}: {outcome}")
    print("| | clips | passed | refused | failed |\n|---|---|---|---|---|")
    for (origin, kind), counts in outcomes.items():
        print(f"| {origin}, {kind} | {counts.total()} |" + _columns(counts))
    total = sum(outcomes.values(), Counter[str]())
    print(f"| all | {total.total()} |" + _columns(total))
    print(f"\npassed: {total['passed'] / max(total.total(), 1):.1%}, bar {BAR:.0%}\n")
    print("\n".join(reasons))


def _columns(counts: Counter[str]) -> str:
    return "".join(f" {counts[name]} |" for name in ("passed", "refused", "failed"))


def measured(clip: MotionClip) -> str:
    """Return `passed`, `refused: why` or `failed: the bar`."""
    try:
        (loop,) = edit(clip, [{"op": "loop"}])
    except InvalidInput as error:
        return f"refused: {error.message}"
    (played,) = edit(loop, [{"op": "concat", "with": loop}] * 2)
    faults = [*_seams(clip, loop, played), *_feet(clip, loop, played), *_kept(clip, loop)]
    return f"failed: {', '.join(faults)}" if faults else "passed"


def _seams(clip: MotionClip, loop: MotionClip, played: MotionClip) -> Iterator[str]:
    step, change = (np.linalg.norm(np.diff(clip.joints, n, axis=0), axis=-1) for n in (1, 2))
    mine, bend = (np.linalg.norm(np.diff(played.joints, n, axis=0), axis=-1) for n in (1, 2))
    for seam in (loop.frames - 1, 2 * (loop.frames - 1)):
        around = mine[seam - 1 : seam + 1] / (np.percentile(step, 95, axis=0) + 1.1e-4)
        if around.max() > 1:
            yield f"step {around.max():.2f} of the bar"
        if (most := float((bend[seam - 1] / (np.percentile(change, 95, axis=0) + 1.1e-4)).max())) > 1:
            yield f"change of step {most:.2f} of the bar"
    for view in (played.joints, played.joints - played.joints[:, :1] * np.array([1.0, 0.0, 1.0])):
        if (most := _peak(view.astype(np.float64), loop.frames - 1)) > 1:
            yield f"a joint moves {most:.2f} of the bar, by the rest of the cycle"
    blend = loop.manifest["loop"]["blend_frames"]
    own = slice(loop.frames - 1 - blend["last"], loop.frames - 1 + blend["first"])
    for name, found, source in (("step", mine, step), ("change of step", bend, change)):
        if (most := float((found[own] / (source.max(axis=0) + 1.1e-4)).max(initial=0.0))) > 1.1:
            yield f"{name} {most:.2f} of the largest of the source, in the blend"


def _peak(joints: np.ndarray, cycle: int) -> float:
    """Return the largest step of a joint, or change of step, at the first seam, over the bar by the rest of a cycle."""
    most = 0.0
    for number in (1, 2):
        values = np.linalg.norm(np.diff(joints, number, axis=0), axis=-1)[:cycle]
        most = max(most, float((values[-number:].max(axis=0) / (1.1 * values[:-number].max(axis=0) + 6e-4)).max()))
    return most


def _feet(clip: MotionClip, loop: MotionClip, played: MotionClip) -> Iterator[str]:
    source, three = (find_contacts(each.joints, each.skeleton, each.fps) for each in (clip, played))
    usual, found = (skate(c.joints, s, c.skeleton, c.fps) for c, s in ((clip, source), (played, three)))
    if found > 1.1 * usual + 0.0021:
        yield f"feet slide at {1000 * found:.1f} mm/s, source {1000 * usual:.1f}"
    spans = standing_spans(supports(played.joints, three, played.skeleton, played.fps))
    blend = round(0.3 * clip.fps)
    for (_, end, foot), (begin, _, other) in pairwise(spans):
        if foot == other and any(end - 1 <= s + blend and begin >= s - blend for s in _seam_frames(loop)):
            yield "a foot stands twice in a row"


def _seam_frames(loop: MotionClip) -> tuple[int, int]:
    return loop.frames - 1, 2 * (loop.frames - 1)


def _kept(clip: MotionClip, loop: MotionClip) -> Iterator[str]:
    """Check that frames before the blend are those of the source, and the length of the cycle."""
    about: Any = loop.manifest["loop"]
    first, last = about["source_frames"]
    turn, shift = placement_of(loop)
    placed = rotate(turn, loop.joints.astype(np.float64)) + shift
    blend = about["blend_frames"]
    longest = 0.3 if has_steps(clip, clip.contacts) else max(STILL)
    if sum(blend.values()) > longest * clip.fps + 1e-6:
        yield f"a blend of {sum(blend.values())} frames"
    own = slice(blend["first"], last - first + 1 - blend["last"])
    if (off := float(np.abs(placed[own] - clip.joints[first : last + 1][own]).max(initial=0.0))) > 1e-4:
        yield f"frames outside the blend differ by {1000 * off:.2f} mm"
    feet = supports(clip.joints, find_contacts(clip.joints, clip.skeleton, clip.fps), clip.skeleton, clip.fps).T
    steps = [sum(first < begin <= last for begin, _ in runs(each)) for each in feet]
    if min(steps) == 0 and about["cycle"]["seconds"] < 2 - 1e-6:
        yield f"{about['cycle']['seconds']:g} s without a step of each foot"


@dataclass(frozen=True)
class _Found:
    name: str
    joints: np.ndarray


def captured() -> Iterator[tuple[str, str, str, MotionClip]]:
    """Yield captured clips, `EACH` of a kind, spread evenly over the sets."""
    folder = Path(os.environ.get("MAREY_DATA", "../shared/data")) / "open-motions" / "commercial"
    found: dict[str, list[_Found]] = defaultdict(list)
    for name in SETS:
        if not (folder / name).is_dir():
            print(f"no captures in {folder / name}: left out")
            continue
        for kind, each in _of_set(CaptureSet.known(name, folder / name)):
            found[kind].append(each)
    for kind, all_clips in found.items():
        picked = np.unique(
            np.linspace(0, len(all_clips) - 1, min(EACH["captured"], len(all_clips))).round().astype(int)
        )
        for index in picked:
            yield "captured", kind, all_clips[index].name, _solved(all_clips[index].joints)


def _of_set(captures: CaptureSet) -> Iterator[tuple[str, _Found]]:
    rows = defaultdict(list)
    for row in captures.rows:
        if row.action in KINDS:
            rows[row.stem].append(row)
    for name, data in bvh_files(captures.path):
        if name not in rows:
            continue
        _, joints = retarget_file(name, data, captures.dataset)
        scale = FPS / captures.dataset.index_fps
        for row in rows[name]:
            first = 0 if row.start is None else round(row.start * scale)
            last = len(joints) if row.end is None else round(row.end * scale)
            piece = joints[first : min(last, first + round(LONGEST * FPS))]
            if len(piece) >= SHORTEST[row.action] * FPS:
                yield row.action, _Found(f"{captures.dataset.name} {row.id or row.stem}", piece)


def _solved(joints: np.ndarray) -> MotionClip:
    pose = solve_pose(joints, HUMANML3D, fps=FPS)
    return MotionClip.of(pose.skeleton, pose.rotations, pose.root, find_contacts(pose.joints, pose.skeleton, FPS), FPS)


def generated() -> Iterator[tuple[str, str, str, MotionClip]]:
    """Yield generated motions of six seconds, `EACH` of a kind."""
    try:
        model = load("hgm3-open")
    except NotFound:
        print("no bundle hgm3-open: no generated motions")
        return
    for kind, prompt in KINDS.items():
        for number, clip in enumerate(model.stream([prompt], seed=1, seconds=6.0, variants=EACH["generated"])):
            yield "generated", kind, f"seed {1 + number}", clip


if __name__ == "__main__":
    main()
