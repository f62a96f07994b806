"""Run inside Blender (or with the `bpy` module): import the motions of a folder and save where their joints are.

    python blender_motions.py FOLDER OPERATOR

OPERATOR is a key of `ENDINGS`. Beside `a.fbx`, for instance, `a.npz` holds `joints` (T, J, 3) in metres, turned back to
Y up, at each key, `rest` (J, 3), `names`, `times` in seconds, `fps` of the scene, `empties` and `points` (V, 3) of the
meshes in the last frame.
"""

import sys
from pathlib import Path

import bpy  # before addon_utils: it puts Blender's own modules on the path

import addon_utils  # isort: skip
import numpy as np

ENDINGS = {"import_scene.fbx": "fbx", "wm.fbx_import": "fbx", "import_scene.gltf": "glb", "wm.usd_import": "usd"}
RATES = {"import_scene.gltf": 24000}
"""Frames a second of the scene before an import: glTF has seconds, and keys come to stand at fractions of frames."""


def y_up(places):
    return np.asarray(places, float).reshape(-1, 3)[:, [0, 2, 1]] * [1, 1, -1]


def look(source, operator):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for addon in ("io_scene_fbx", "io_scene_gltf2"):
        addon_utils.enable(addon)
    scene = bpy.context.scene
    if operator in RATES:
        scene.render.fps, scene.render.fps_base = RATES[operator], 1.0
    group, name = operator.split(".")
    getattr(getattr(bpy.ops, group), name)(filepath=str(source))
    armature = next(o for o in scene.objects if o.type == "ARMATURE")
    bones = armature.pose.bones
    rest = y_up([armature.matrix_world @ bone.bone.head_local for bone in bones])
    strips = armature.animation_data
    if strips.action is None:
        strips.action = strips.nla_tracks[0].strips[0].action
    action = strips.action
    curves = action.layers[0].strips[0].channelbags[0].fcurves if hasattr(action, "layers") else action.fcurves
    frames = sorted({round(point.co[0], 4) for curve in curves for point in curve.keyframe_points})
    joints = np.empty((len(frames), len(bones), 3))
    for row, frame in enumerate(frames):
        whole = int(np.floor(frame))
        scene.frame_set(whole, subframe=frame - whole)
        joints[row] = y_up([armature.matrix_world @ bone.head for bone in bones])
    graph = bpy.context.evaluated_depsgraph_get()
    points = [
        o.matrix_world @ vertex.co
        for o in (each.evaluated_get(graph) for each in scene.objects if each.type == "MESH")
        for vertex in o.data.vertices
    ]
    fps = scene.render.fps / scene.render.fps_base
    return {
        "joints": joints,
        "rest": rest,
        "names": np.array([bone.name for bone in bones]),
        "times": (np.array(frames) - frames[0]) / fps,
        "fps": fps,
        "empties": sum(o.type == "EMPTY" for o in scene.objects),
        "points": y_up(points),
    }


folder, chosen = sys.argv[-2:]
for path in sorted(Path(folder).glob(f"*.{ENDINGS[chosen]}")):
    np.savez(path.with_suffix(".npz"), **look(path, chosen))
