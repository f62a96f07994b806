"""Write and read USD files with `usd-core`, as a Python with it and numpy does: what is written, and its faults.

    python usd_check.py FOLDER

Beside each `a.npz` of the folder, which Marey wrote, `a.usd` is read: `a.json` gets the faults that the validators of
pxr.UsdValidation find, the joints' names, places in metres and Y up, and times in seconds.
"""

import json
import sys
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel, UsdValidation


def look(path):
    stage = Usd.Stage.Open(str(path))
    registry = UsdValidation.ValidationRegistry()
    names = [each.name for each in registry.GetAllValidatorMetadata() if "Package" not in each.name]
    context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
    faults = [f"{each.GetName()}: {each.GetMessage()}" for each in context.Validate(stage)]
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Character/Skeleton"))
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetDefaultPrim()), Usd.TraverseInstanceProxies())
    query = cache.GetSkelQuery(skeleton)
    rate, unit = stage.GetTimeCodesPerSecond(), UsdGeom.GetStageMetersPerUnit(stage)
    codes = query.GetAnimQuery().GetJointTransformTimeSamples()
    places = np.array([
        [list(matrix.ExtractTranslation()) for matrix in query.ComputeJointSkelTransforms(code)] for code in codes
    ]) * unit  # fmt: skip
    rest = np.array([list(m.ExtractTranslation()) for m in query.ComputeJointSkelTransforms(0, True)]) * unit
    if UsdGeom.GetStageUpAxis(stage) == "Z":
        places, rest = (each[..., [0, 2, 1]] * [1, 1, -1] for each in (places, rest))
    return {
        "faults": faults,
        "validators": len(names),
        "names": list(skeleton.GetJointNamesAttr().Get()),
        "paths": list(skeleton.GetJointsAttr().Get()),
        "joints": places.tolist(),
        "rest": rest.tolist(),
        "times": [code / rate for code in codes],
        "end": stage.GetEndTimeCode(),
    }


for path in sorted(Path(sys.argv[1]).glob("*.usd")):
    path.with_suffix(".json").write_text(json.dumps(look(path)), encoding="utf-8")
