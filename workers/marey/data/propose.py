"""Proposal of a `dataset.toml` for a folder of BVH files: the unit, the axes, and a rig for each kind of skeleton.

Joints are recognised by their names at the ends of the limbs, and by the tree from there on. Terms are left for the
owner of the captures to fill in.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile, NotFound
from marey.data.dataset import INDEX
from marey.data.recognise import BodyJoints
from marey.motion.io.bvh import BvhClip, read_bvh
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import rotate
from marey.motion.units import METRES, Unit, Up

Array = NDArray[np.floating]
LEG = 0.84
"""Metres from hip to ankle of a body of 1.75 m."""
MAX_FILES = 400
"""Files whose skeletons are compared."""
MAX_READ = 5
"""Files of one kind of skeleton that are measured."""
UPRIGHT = 22.0
"""Degrees by which trunk, thighs and shins of a rest pose may lean to count as standing."""
ASIDE, STEEP = 30.0, 75.0
"""Degrees by which a foot of a rest pose may point aside, and from which on it points down."""
RARE_UNIT = 0.7
"""Logarithm of the factor by which a leg has to fit inches or feet better than metres, centimetres or millimetres."""
TOE_HEIGHTS = (0.003, 0.08)
"""Metres: heights of a standing toe joint that are stated."""

_COLUMNS = {
    "file": ("file", "filename", "path", "clip", "trial", "take", "name"),
    "action": ("action", "label", "class", "category", "description"),
    "captions": ("captions", "caption", "text", "prompt"),
    "source": ("source", "session", "trial", "take", "clip", "file"),
}


@dataclass(frozen=True)
class ProposedRig:
    """Joints of a skeleton, by their parts; feet and axes where the rest pose does not stand."""

    name: str
    trunk: Sequence[str]  # pelvis, spine, middle, chest, neck, head
    legs: Sequence[Sequence[str]]
    arms: Sequence[Sequence[str]]
    stands: bool
    left: tuple[float, float, float]
    up: tuple[float, float, float]
    feet: Sequence[tuple[float, float, float]] = ()
    sole_pitch: float | None = None
    toe_height: float | None = None
    files: int = 1


@dataclass(frozen=True)
class Proposal:
    """Findings in a folder of BVH files.

    Attributes:
        name: of the set, from the folder.
        unit, up: of the files.
        rigs: one for each kind of skeleton.
        columns: Marey's columns from those of the index; empty where there is none.
        problems: files that cannot be read, and skeletons without a rig, with the reason.
    """

    name: str
    unit: Unit
    up: Up
    rigs: tuple[ProposedRig, ...]
    columns: dict[str, str] = field(default_factory=dict[str, str])
    problems: tuple[str, ...] = ()

    def toml(self) -> str:
        """Return the text of a `dataset.toml`."""
        lines = [
            "# Proposed from the files. Fill in the terms, and check each rig by `marey data prepare` and a look.",
            f"name = {_quoted(self.name)}",
            'title = ""',
            'licence = ""',
            'credit = ""',
            'tier = ""  # commercial, sharealike or non-commercial',
            f"unit = {_quoted(self.unit)}",
            f"up = {_quoted(self.up)}",
            *(f"# {problem}" for problem in self.problems),
        ]
        if self.columns:
            lines += ["", "[columns]", *(f"{name} = {_quoted(value)}" for name, value in self.columns.items())]
        for rig in self.rigs:
            lines += ["", f"[[rig]]  # of {rig.files} files", *_rig_lines(rig)]
        return "\n".join(lines) + "\n"


def bvh_files(folder: Path) -> Iterator[Path]:
    """Yield the BVH files of a folder, at any depth."""
    return (path for path in folder.rglob("*") if path.suffix.lower() == ".bvh")


def propose(folder: Path) -> Proposal:
    """Look at the BVH files of a folder.

    Raises:
        NotFound: there are none.
        InvalidFile: no file is a human body with joints that are recognised.
    """
    paths = sorted(bvh_files(folder))[:MAX_FILES]
    if not paths:
        raise NotFound("there are no BVH files", where=str(folder))
    kinds: dict[tuple[str, ...], list[BvhClip]] = {}
    counts: dict[tuple[str, ...], int] = {}
    problems: list[str] = []
    for path in paths:
        try:
            clip = read_bvh(path, unit="m")
        except InvalidFile as error:
            problems.append(f"{path.relative_to(folder)}: {error.message}")
            continue
        names = clip.skeleton.joint_names
        counts[names] = counts.get(names, 0) + 1
        if len(kinds.setdefault(names, [])) < MAX_READ:
            kinds[names].append(clip)
    found: list[tuple[_Body, int]] = []
    for names, clips in kinds.items():
        try:
            found.append((_Body.of(clips), counts[names]))
        except InvalidFile as error:
            problems.append(f"a skeleton of {counts[names]} files, with the root {names[0]!r}: {error.message}")
    if not found:
        raise InvalidFile(f"no rig is recognised: {problems[0]}", where=str(folder), hint="Write dataset.toml by hand.")
    unit = _unit(float(np.median([body.leg for body, _ in found])))
    up: Up = "z" if sum(body.z_up for body, _ in found) * 2 > len(found) else "y"
    names = _numbered(len(found))
    rigs = [body.rig(name, METRES[unit], files) for (body, files), name in zip(found, names, strict=True)]
    return Proposal(_slug(folder.name), unit, up, tuple(rigs), _columns(folder / INDEX, paths), tuple(problems))


def index_of(folder: Path) -> str:
    """Return the text of an `index.csv` with a line for each BVH file; actions and captions are left to fill in."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(("file", "action", "captions", "source"))
    for path in sorted(bvh_files(folder)):
        writer.writerow((path.relative_to(folder).as_posix(), "", "", path.stem))
    return out.getvalue()


class _Body:
    """A human body in clips of one skeleton, in the file's unit."""

    def __init__(self, clips: Sequence[BvhClip], tree: BodyJoints) -> None:
        self._clips, self._tree = clips, tree
        places = np.concatenate([clip.joints()[::5] for clip in clips])
        self._ankles = [leg[2] for leg in tree.legs]
        standing = places[:, tree.trunk[-1]] - places[:, self._ankles].mean(axis=1)
        self.z_up = bool(np.abs(np.median(standing, axis=0)).argmax() == 2)
        rest = clips[0].skeleton.rest
        hip, knee, ankle = (rest[[leg[part] for leg in tree.legs]] for part in range(3))
        self.leg = float((np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)).mean())
        self._rest = rest

    @classmethod
    def of(cls, clips: Sequence[BvhClip]) -> _Body:
        return cls(clips, BodyJoints.of(clips[0]))

    def rig(self, name: str, metres: float, files: int) -> ProposedRig:
        """Return the rig; `metres` is the file's unit."""
        tree, rest = self._tree, self._rest
        hips = [leg[0] for leg in tree.legs]
        left, up = _axis(rest[hips[0]] - rest[hips[1]]), _axis(rest[tree.trunk[-1]] - rest[hips].mean(axis=0))
        bones = [(tree.trunk[3], tree.trunk[0]), *((leg[part], leg[part + 1]) for leg in tree.legs for part in (0, 1))]
        leans = [_degrees(rest[upper] - rest[lower], up) for upper, lower in bones]
        stands = abs(float(left @ up)) < 0.5 and max(leans) < UPRIGHT
        flat = stands and self._rests_flat(left, up)
        feet, pitch, height = self._feet()
        lowest, highest = (value / metres for value in TOE_HEIGHTS)
        return ProposedRig(
            name=name,
            trunk=[tree.name(joint) for joint in tree.trunk],
            legs=[[*(tree.name(joint) for joint in leg[:3]), tree.toe(leg)] for leg in tree.legs],
            arms=[[tree.name(joint) for joint in arm] for arm in tree.arms],
            stands=stands,
            left=_three(left if stands else np.array([1.0, 0, 0])),
            up=_three(up if stands else np.array([0, 1.0, 0])),
            feet=() if flat else feet,
            sole_pitch=None if flat else pitch,
            toe_height=round(height, 1 if metres < 0.1 else 3) if lowest <= height <= highest else None,
            files=files,
        )

    def _rests_flat(self, left: Array, up: Array) -> bool:
        """Return True if both feet of the rest pose point ahead."""
        for leg in self._tree.legs:
            foot = self._tree.toe_rest(leg) - self._rest[leg[2]]
            level = foot - (foot @ up) * up
            if _degrees(foot, -up) < 90 - STEEP or _degrees(level, np.cross(left, up)) > ASIDE:
                return False
        return True

    def _feet(self) -> tuple[Sequence[tuple[float, float, float]], float, float]:
        """Directions to the body's left in the frames of the ankles, pitch of the sole in degrees and height of the
        toes, in frames in which each foot stands: the slower ones of those with the lowest toe."""
        across: list[list[Array]] = [[], []]
        pitches: list[float] = []
        heights: list[float] = []
        for clip in self._clips:
            world, places = global_rotations(clip.skeleton, clip.rotations), clip.joints()
            vertical = 2 if self.z_up else 1
            for side, leg in enumerate(self._tree.legs):
                ankle, toe = places[:, leg[2]], self._tree.toe_places(leg, places, world, clip)
                speed = np.linalg.norm(np.gradient(toe, axis=0), axis=1) * clip.fps if len(toe) > 1 else np.zeros(1)
                low = np.flatnonzero(toe[:, vertical] <= np.percentile(toe[:, vertical], 30))
                still = low[speed[low] <= np.median(speed[low])]
                foot = toe[still] - ankle[still]
                length = np.linalg.norm(foot, axis=1)
                pitches += np.degrees(np.arcsin(np.clip(-foot[:, vertical] / length, -1, 1))).tolist()
                heights += toe[still, vertical].tolist()
                upward = np.eye(3)[vertical]
                lateral = np.cross(upward, foot)
                own = rotate(world[still, leg[2]] * [1, -1, -1, -1], lateral)
                across[side] += list(own / np.linalg.norm(own, axis=1, keepdims=True))
        feet = [_three(_unit_vector(np.median(found, axis=0)), 2) for found in across]
        return feet, round(float(np.median(pitches)), 1), float(np.median(heights))


def _columns(index: Path, files: Sequence[Path]) -> dict[str, str]:
    """Return Marey's columns from those of an index; the column of files is one that names them."""
    try:
        with index.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error):
        return {}
    header = list(rows[0]) if rows else []
    stems = {path.stem for path in files}
    named = [name for name in header if name and any(Path(row[name] or "").stem in stems for row in rows[:MAX_FILES])]
    lower = {name.lower(): name for name in header if name and (name in named or name.lower() not in _COLUMNS["file"])}
    found = {
        column: f"{{{lower[known]}}}"
        for column, names in _COLUMNS.items()
        if (known := next((name for name in names if name in lower), None)) is not None
    }
    return {column: value for column, value in found.items() if value != f"{{{column}}}"}


def _rig_lines(rig: ProposedRig) -> Iterator[str]:
    yield f"name = {_quoted(rig.name)}"
    for part, joint in zip(("pelvis", "spine", "middle", "chest", "neck", "head"), rig.trunk, strict=True):
        yield f"{part} = {_quoted(joint)}"
    for part, chains in (("leg", rig.legs), ("arm", rig.arms)):
        for side, chain in zip(("left", "right"), chains, strict=True):
            yield f"{side}_{part} = [{', '.join(map(_quoted, chain))}]"
    if not rig.stands:
        yield 'trunk = "positions"  # with all rotations zero the body does not stand'
    if rig.feet:
        if (rig.sole_pitch or 0.0) > STEEP:
            yield '# The feet point down: give ankle and toe as places, { joint = "Foot", offset = [0, 1, 13] }.'
        for side, foot in zip(("left", "right"), rig.feet, strict=False):
            yield f"{side}_foot = {list(foot)}"
        yield f"sole_pitch = {rig.sole_pitch}"
    if rig.left != (1.0, 0.0, 0.0):
        yield f"rest_left = {list(rig.left)}"
    if rig.up != (0.0, 1.0, 0.0):
        yield f"rest_up = {list(rig.up)}"
    if rig.toe_height is not None:
        yield f"toe_height = {rig.toe_height}"


def _unit(leg: float) -> Unit:
    units: tuple[Unit, ...] = ("m", "cm", "mm", "in", "ft")
    rare = {"in": RARE_UNIT, "ft": RARE_UNIT}
    return min(units, key=lambda unit: abs(np.log(max(leg, 1e-9) * METRES[unit] / LEG)) + rare.get(unit, 0.0))


def _axis(vector: Array) -> Array:
    """Return the signed axis nearest to a vector."""
    axis = np.zeros(3)
    largest = int(np.abs(vector).argmax())
    axis[largest] = np.sign(vector[largest])
    return axis


def _degrees(one: Array, other: Array) -> float:
    cosine = float(one @ other) / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-9)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _unit_vector(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)


def _three(vector: Array, digits: int = 1) -> tuple[float, float, float]:
    x, y, z = (round(float(value), digits) + 0.0 for value in vector)
    return x, y, z


def _numbered(count: int) -> list[str]:
    return ["rig"] if count == 1 else [f"rig-{number}" for number in range(1, count + 1)]


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9_.-]+", "-", name.lower()).strip("-._") or "captures"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
