"""Play motions of Marey on a character in Blender, check feet and seams, and render a picture.

    pip install bpy==4.5.15      # Python 3.11, in an environment of its own
    python play_on_character.py hero.fbx walk.fbx circle.fbx --picture picture.png

The motions are FBX or glb, as the character's file is, and were written for its skeleton: with `--rig hero.fbx`,
or with `--rig mixamo` for a character of Mixamo. Beside each lies its npz (`--format fbx --format npz`), with contacts
and travel.

A loop is played three times, any other motion once. Exit code 1: a check failed.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy  # before mathutils: it brings Blender's own modules
import numpy as np
from mathutils import Vector

CYCLES = 3
BONES = {
    "hips": ("mixamorig:Hips", "pelvis"),
    "thigh": ("mixamorig:LeftUpLeg", "thigh_l", "L_hip"),
    "right_thigh": ("mixamorig:RightUpLeg", "thigh_r", "R_hip"),
    "shin": ("mixamorig:LeftLeg", "calf_l", "L_knee"),
    "foot": ("mixamorig:LeftFoot", "foot_l", "L_ankle"),
    "left_toes": ("mixamorig:LeftToeBase", "ball_l", "L_foot"),
    "right_toes": ("mixamorig:RightToeBase", "ball_r", "R_foot"),
}
"""Bones by the names of Mixamo, Unreal and Marey; `--bone left_toes=NAME` for others."""
TOES = {"left_toes": ("L_foot", 1), "right_toes": ("R_foot", 3)}
"""Joints of the npz, and columns of its contacts: left ankle, left toes, right ankle, right toes."""
BARS = {"under": 10.0, "over": 30.0, "slip": 20.0, "seam": 1.0, "path": 50.0}
"""Millimetres: a toe under its height in the rest pose; a standing toe over its height in the npz; how far it leaves
its place; what a bone moves, or changes its movement, more at a seam than anywhere else in the cycle; the mean distance
of the hips from their path in the npz: they are set over feet that may be longer."""


@dataclass
class Take:
    """A motion on the character.

    Attributes:
        name: of its file.
        action: the animation.
        places: (T, J, 3) metres, Z up: heads of the bones in the world in every frame, over all cycles.
        cycle: frames of one cycle, or of a motion that is no loop.
        cycles: how often it is played.
        stands: (cycle, 4) bool: contacts.
        path: (cycle, 2) metres: X and Y between the hip joints by the npz, at the scale of the character.
        heights: by the npz and at that scale, height of each toe over that of its rest pose: (cycle,) metres, by part.
        in_place: the file leaves this travel out.
    """

    name: str
    action: bpy.types.Action
    places: np.ndarray
    cycle: int
    cycles: int
    stands: np.ndarray
    path: np.ndarray
    heights: dict[str, np.ndarray]
    in_place: bool


def load(path: Path) -> list[bpy.types.Object]:
    """Import a file; return its objects. The rate of the scene becomes that of an FBX."""
    before = set(bpy.data.objects)
    if path.suffix.lower() == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path))
    else:
        bpy.ops.wm.fbx_import(filepath=str(path))
    return [each for each in bpy.data.objects if each not in before]


def armature_of(objects: list[bpy.types.Object], path: Path) -> bpy.types.Object:
    """Return the armature among the objects of a file."""
    found = [each for each in objects if each.type == "ARMATURE"]
    if not found:
        sys.exit(f"{path}: holds no armature")
    return found[0]


def length_of(places: list) -> float:
    """Return the length in metres of the line through places (3,)."""
    return float(np.linalg.norm(np.diff(np.array(places), axis=0), axis=1).sum())


class Character:
    """A mesh and its armature."""

    def __init__(self, path: Path, names: dict[str, str]) -> None:
        objects = load(path)
        self.armature = armature_of(objects, path)
        self.meshes = [each for each in objects if each.type == "MESH"]
        self.suffix = path.suffix
        self.bones = [bone.name for bone in self.armature.pose.bones]
        self.column = {part: self._column((names[part],) if part in names else BONES[part], part) for part in BONES}
        self._clear()
        self.rest = self.places()
        self.leg = length_of([self.rest[self.column[part]] for part in ("thigh", "shin", "foot")])

    def _column(self, wanted: tuple[str, ...], part: str) -> int:
        for name in wanted:
            if name in self.bones:
                return self.bones.index(name)
        return sys.exit(f"the character has no bone {' or '.join(wanted)}: give its name, --bone {part}=NAME")

    def _clear(self) -> None:
        self.armature.animation_data_clear()
        for bone in self.armature.pose.bones:
            bone.matrix_basis.identity()
        bpy.context.view_layer.update()

    def hips(self, places: np.ndarray) -> np.ndarray:
        """Return X and Y between the hip joints, (T, 2), of places (T, J, 3)."""
        return places[:, [self.column["thigh"], self.column["right_thigh"]], :2].mean(axis=1)

    def places(self) -> np.ndarray:
        """Return where the heads of the bones are: (J, 3) metres, Z up."""
        return np.array([self.armature.matrix_world @ bone.head for bone in self.armature.pose.bones])

    def play(self, action: bpy.types.Action, cycles: int) -> None:
        """Let the armature play an action some times, one after the other, from frame 0."""
        self._clear()
        strip = self.armature.animation_data_create().nla_tracks.new().strips.new("motion", 0, action)
        strip.action_slot = strip.action_suitable_slots[0]
        strip.repeat = cycles

    def _fitting(self, path: Path) -> bpy.types.Action:
        """Import the animation of a motion file, with the places of the hips at the scale of this character's legs."""
        objects = load(path)
        armature = armature_of(objects, path)
        data = armature.animation_data
        action = data.action or data.nla_tracks[0].strips[0].action
        action.use_fake_user = True
        hips, *leg = (self.bones[self.column[part]] for part in ("hips", "thigh", "shin", "foot"))
        if missing := [bone for bone in (hips, *leg) if bone not in armature.data.bones]:
            sys.exit(f"{path}: has no bone {', '.join(missing)}: write it with --rig and the file of the character")
        own = length_of([armature.matrix_world @ armature.data.bones[bone].head_local for bone in leg])
        for curve in action.layers[0].strips[0].channelbags[0].fcurves:
            if curve.data_path == f'pose.bones["{hips}"].location':
                for key in curve.keyframe_points:
                    key.co.y *= self.leg / own
                    key.handle_left.y *= self.leg / own
                    key.handle_right.y *= self.leg / own
        for each in objects:
            bpy.data.objects.remove(each)
        return action

    def take(self, path: Path) -> Take:
        """Play a motion file, and note where the bones are."""
        if path.suffix.lower() != self.suffix.lower():
            sys.exit(f"{path}: is not {self.suffix}, as the character is; their bones have other axes")
        action = self._fitting(path)
        with np.load(path.with_suffix(".npz")) as npz:
            manifest = json.loads(str(npz["manifest"]))
            names, parents, offsets = list(npz["names"]), npz["parents"], npz["offsets"]
            joints, contacts = npz["joints"] * [1, 1, -1], npz["contacts"]
            bpy.context.scene.render.fps = round(float(npz["fps"]))
        loop = manifest.get("loop")
        cycles = CYCLES if loop else 1
        begin, end = action.frame_range
        frames = round(end - begin) + 1
        if frames != len(joints):
            sys.exit(f"{path}: has {frames} frames, and its npz {len(joints)}: write both at one rate")
        cycle = frames - 1 if loop and loop["end"] == "closed" else frames
        scale = self.leg / sum(np.linalg.norm(offsets[names.index(joint)]) for joint in ("L_knee", "L_ankle"))
        hips = [names.index(joint) for joint in ("L_hip", "R_hip")]
        way = scale * joints[:cycle, hips][:, :, [0, 2]].mean(axis=1)  # Y up to Blender's Z up
        rest = offsets.copy()
        for joint, parent in enumerate(parents):
            rest[joint] += rest[parent] if parent >= 0 else 0.0
        heights = {}
        for part, (joint, _) in TOES.items():
            column = names.index(joint)
            heights[part] = scale * (joints[:cycle, column, 1] - rest[column, 1] + rest[:, 1].min())
        self.play(action, cycles)
        places = []
        for frame in range(cycle * cycles):
            bpy.context.scene.frame_set(frame)
            places.append(self.places())
        own = np.array(places)
        in_place = np.ptp(self.hips(own[:cycle]), axis=0).max() < 0.2 * np.ptp(way, axis=0).max()
        return Take(path.stem, action, own, cycle, cycles, contacts[:cycle], way, heights, bool(in_place))


# ---------------------------------------------------------------- checks
def check(take: Take, character: Character) -> bool:
    """Print what is measured, in millimetres, and return True if all of it keeps its bar."""
    kind = f"{take.cycles} cycles of {take.cycle} frames" if take.cycles > 1 else f"{take.cycle} frames"
    print(f"{take.name}: {kind}{', in place' if take.in_place else ''}")
    found = feet(take, character)
    if take.cycles > 1:
        found["seam"] = seams(take)
    if not take.in_place:
        hips = character.hips(take.places[: take.cycle])
        away = (hips - hips.mean(axis=0)) - (take.path - take.path.mean(axis=0))
        found["path"] = np.linalg.norm(away, axis=-1).mean()
    for name, metres in found.items():
        missed = "" if 1000 * metres <= BARS[name] else "  MISSED"
        print(f"  {name:6}{1000 * metres:8.1f} mm, allowed {BARS[name]:g}{missed}")
    return all(1000 * metres <= BARS[name] for name, metres in found.items())


def feet(take: Take, character: Character) -> dict[str, float]:
    """Return how far toes are under the floor, and standing toes over it and from their place, metres.

    Where a file is in place, its travel is put back first: a standing foot moves back under the body there.
    """
    under, over, slip = 0.0, 0.0, 0.0
    for part, (_, contact) in TOES.items():
        rest = character.rest[character.column[part], 2]
        for begin in range(0, len(take.places), take.cycle):
            places = take.places[begin : begin + take.cycle, character.column[part]].copy()
            if take.in_place:
                places[:, :2] += take.path
            under = max(under, rest - places[:, 2].min())
            for first, end in runs(take.stands[:, contact]):
                standing = places[first:end]
                over = max(over, (standing[:, 2] - rest - take.heights[part][first:end]).max())
                middle = np.median(standing[:, :2], axis=0)
                slip = max(slip, np.linalg.norm(standing[:, :2] - middle, axis=-1).max())
    return {"under": under, "over": over, "slip": slip}


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return first frame and end of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def seams(take: Take) -> float:
    """Return how much more a bone moves, or changes its movement, at a seam than anywhere else in a cycle, metres."""
    step = np.diff(take.places, axis=0)
    worst = 0.0
    for values, across in ((step, 1), (np.diff(step, axis=0), 2)):
        lengths = np.linalg.norm(values, axis=-1)
        usual = lengths[: take.cycle - 1 - (across - 1)].max(axis=0)
        for seam in range(take.cycle, len(take.places), take.cycle):
            worst = max(worst, float((lengths[seam - across : seam] - usual).max()))
    return worst


# ---------------------------------------------------------------- the picture
COLOURS = ((0.04, 0.25, 0.62), (0.85, 0.30, 0.05), (0.10, 0.42, 0.22))
FIGURES = 7
"""Poses of each motion."""
ROW = 0.75
"""Metres between the figures of a motion in place."""


def render(takes: list[Take], character: Character, target: Path, samples: int) -> None:
    """Render poses of every motion, each motion in a colour and before the last one, seen from their right."""
    scene = bpy.context.scene
    spots, free = [], 0.0
    for number, take in enumerate(takes):
        paint = material(COLOURS[number % len(COLOURS)])
        character.play(take.action, 1)
        frames = np.linspace(0, take.cycle, FIGURES, endpoint=False).astype(int)
        hips = take.places[frames, character.column["hips"], :2]
        wanted = np.outer(np.arange(FIGURES), [0.0, -ROW]) if take.in_place else hips - [hips[:, 0].mean(), 0.0]
        wanted[:, 1] += free - wanted[:, 1].max()
        free = wanted[:, 1].min() - 1.2
        spots.append(wanted)
        for frame, move in zip(frames.tolist(), wanted - hips, strict=True):
            scene.frame_set(frame)
            freeze(character.meshes, paint, move)
    for each in (*character.meshes, character.armature):
        each.hide_render = True
    stage(np.concatenate(spots), 2.1 * character.leg)
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = True
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(target.resolve())
    bpy.ops.render.render(write_still=True)


def freeze(meshes: list[bpy.types.Object], paint: bpy.types.Material, move: np.ndarray) -> None:
    """Leave a copy of the meshes where they are now, moved on the floor."""
    graph = bpy.context.evaluated_depsgraph_get()
    for mesh in meshes:
        posed = mesh.evaluated_get(graph)
        copy = bpy.data.objects.new("figure", bpy.data.meshes.new_from_object(posed))
        copy.data.materials.clear()
        copy.data.materials.append(paint)
        copy.matrix_world = posed.matrix_world.copy()
        copy.location.x += move[0]
        copy.location.y += move[1]
        bpy.context.scene.collection.objects.link(copy)


def material(colour: tuple[float, float, float], rough: float = 0.55) -> bpy.types.Material:
    """Return a plain material."""
    made = bpy.data.materials.new("plain")
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    shader.inputs["Roughness"].default_value = rough
    return made


def stage(spots: np.ndarray, tall: float) -> None:
    """Add floor, sun, sky and a camera that sees all figures, which stand at spots (N, 2)."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60)
    bpy.context.object.data.materials.append(material((0.80, 0.81, 0.83), 0.9))
    bpy.ops.object.light_add(type="SUN", rotation=(math.radians(40), 0, math.radians(-60)))
    bpy.context.object.data.energy = 2.2
    bpy.context.object.data.angle = math.radians(4)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.85, 0.90, 1.0, 1.0)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.55
    low, high = spots.min(axis=0) - 0.5, spots.max(axis=0) + 0.5
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, tall)]
    bpy.ops.object.camera_add(rotation=(math.radians(72), 0, math.radians(-90)))
    scene.camera = camera = bpy.context.object
    camera.data.lens = 50
    bpy.context.view_layer.update()
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 1200, 400, 100
    where, _ = camera.camera_fit_coords(bpy.context.evaluated_depsgraph_get(), [x for each in corners for x in each])
    camera.location = Vector(where)


def main() -> int:
    """Read the command line; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("character", type=Path, help="FBX or glb with a mesh and its skeleton")
    parser.add_argument("motions", type=Path, nargs="+", help="FBX or glb for that skeleton, each beside its npz")
    parser.add_argument("--bone", action="append", default=[], metavar="PART=NAME", help=f"PART: {', '.join(BONES)}")
    parser.add_argument("--picture", type=Path, help="PNG to render")
    parser.add_argument("--samples", type=int, default=24, help="of each pixel; default: 24")
    given = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    character = Character(given.character, dict(each.split("=", 1) for each in given.bone))
    takes = [character.take(motion) for motion in given.motions]
    kept = [check(take, character) for take in takes]
    if given.picture:
        render(takes, character, given.picture, given.samples)
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
