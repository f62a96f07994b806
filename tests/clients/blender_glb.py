"""Run inside Blender (or with the `bpy` module): import a glb file and save where its joints are.

    python blender_glb.py IN.glb OUT.npz

OUT holds `joints` (T, J, 3) in metres, turned back to Y up, `names` and `times` in seconds.
"""

import sys

import bpy  # before addon_utils: it puts Blender's own modules on the path

import addon_utils  # isort: skip
import numpy as np

RATE = 24000  # of the scene: high, because the importer puts keys at fractions of frames

source, target = sys.argv[-2:]
bpy.ops.wm.read_factory_settings(use_empty=True)
addon_utils.enable("io_scene_gltf2")
scene = bpy.context.scene
scene.render.fps = RATE
scene.render.fps_base = 1.0
bpy.ops.import_scene.gltf(filepath=source)
armature = next(o for o in scene.objects if o.type == "ARMATURE")
assert not [o for o in scene.objects if o.type == "EMPTY"]
bones = armature.pose.bones
strips = armature.animation_data
action = strips.action or strips.nla_tracks[0].strips[0].action
strips.action = action
curves = action.layers[0].strips[0].channelbags[0].fcurves if hasattr(action, "layers") else action.fcurves
frames = sorted({point.co[0] for curve in curves for point in curve.keyframe_points})
joints = np.empty((len(frames), len(bones), 3))
for row, frame in enumerate(frames):
    scene.frame_set(int(frame), subframe=frame - int(frame))
    joints[row] = [armature.matrix_world @ bone.head for bone in bones]
joints = joints[..., [0, 2, 1]] * [1, 1, -1]  # Blender's Z up to Y up
rest = np.array([armature.matrix_world @ bone.bone.head_local for bone in bones])[:, [0, 2, 1]] * [1, 1, -1]
names = np.array([bone.name for bone in bones])
np.savez(target, joints=joints, rest=rest, names=names, times=np.array(frames) / RATE)
