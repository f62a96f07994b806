"""Read an FBX file with ufbx (the package `pufbx`) and print its nodes and motion as JSON, in the unit of the file.

    python ufbx_joints.py IN.fbx [RATE]

`rest` holds the matrix of each node from its space to the world, rows of 4; `local` (nodes, frames, 10) positions,
quaternions x y z w and scales from the parent, sampled RATE times a second.
"""

import json
import sys

import pufbx

source, *rate = sys.argv[1:]
scene = pufbx.load_fbx(source)
nodes = list(scene.nodes)
place = {node.typed_id: index for index, node in enumerate(nodes)}
found = {
    "names": [node.name for node in nodes],
    "parents": [-1 if node.parent is None else place[node.parent.typed_id] for node in nodes],
    "rest": [[[node.node_to_world[f"m{row}{column}"] for column in range(4)] for row in range(3)] for node in nodes],
    "bones": [node.bone is not None for node in nodes],
}
if rate:
    data, times, names = pufbx.anim_to_array(source, anim_index=0, resample_rate=float(rate[0]))
    found |= {"local": data.tolist(), "times": times.tolist(), "moving": list(names)}
print(json.dumps(found))
