"""Run inside Blender (or with the `bpy` module): import the FBX files of a folder and save where their joints are.

    python blender_fbx.py FOLDER OPERATOR

OPERATOR is `import_scene.fbx` or `wm.fbx_import`. Beside `a.fbx`, `a.npz` holds `joints` (T, J, 3) in metres, turned
back to Y up, `rest` (J, 3), `names`, `times` in seconds, `empties` and `points` (V, 3) of the meshes in the last frame.
"""

import sys
from pathlib import Path

import bpy  # before addon_utils: it puts Blender's own modules on the path

import addon_utils  # isort: skip
import numpy as np


def y_up(places):
    return np.asarray(places, float).reshape(-1, 3)[:, [0, 2, 1]] * [1, 1, -1]


def look(source, group, name):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("io_scene_fbx")
    getattr(getattr(bpy.ops, group), name)(filepath=str(source))
    scene = bpy.context.scene
    armature = next(o for o in scene.objects if o.type == "ARMATURE")
    bones = armature.pose.bones
    rest = y_up([armature.matrix_world @ bone.bone.head_local for bone in bones])
    strips = armature.animation_data
    action = strips.action or strips.nla_tracks[0].strips[0].action
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


folder, operator = sys.argv[-2:]
for path in sorted(Path(folder).glob("*.fbx")):
    np.savez(path.with_suffix(".npz"), **look(path, *operator.split(".")))
