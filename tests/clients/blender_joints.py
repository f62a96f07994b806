"""Run inside Blender (or with the `bpy` module): import a BVH file and save where its joints are.

    python blender_joints.py IN.bvh OUT.npz

OUT holds `joints` (T, J, 3) in metres, turned back to Y up, `names` and `fps`.
"""

import sys

import bpy  # before addon_utils: it puts Blender's own modules on the path

import addon_utils  # isort: skip
import numpy as np

source, target = sys.argv[-2:]
bpy.ops.wm.read_factory_settings(use_empty=True)
addon_utils.enable("io_anim_bvh")
bpy.ops.import_anim.bvh(
    filepath=source,
    global_scale=0.01,
    axis_forward="-Z",
    axis_up="Y",
    frame_start=1,
    update_scene_fps=True,
    rotate_mode="NATIVE",
)
scene = bpy.context.scene
armature = next(o for o in scene.objects if o.type == "ARMATURE")
bones = armature.pose.bones
first, last = armature.animation_data.action.frame_range
frames = range(int(first), int(last) + 1)
joints = np.empty((len(frames), len(bones), 3))
for row, frame in enumerate(frames):
    scene.frame_set(frame)
    joints[row] = [armature.matrix_world @ bone.head for bone in bones]
joints = joints[..., [0, 2, 1]] * [1, 1, -1]  # Blender's Z up to Y up
fps = scene.render.fps / scene.render.fps_base
np.savez(target, joints=joints, names=np.array([bone.name for bone in bones]), fps=fps)
