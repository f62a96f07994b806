"""Read USD files with `usd-core`: the faults in them, and where joints are.

    python usd_check.py FOLDER [--faults]

With --faults they are printed, and nothing else is read. Beside each `a.usd`, `a.json` gets the faults
that the validators of pxr.UsdValidation find, the joints' names, places in metres and Y up, and times in seconds.
"""

import json
import sys
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel, UsdValidation


def faults_of(stage):
    registry = UsdValidation.ValidationRegistry()
    names = [each.name for each in registry.GetAllValidatorMetadata() if "Package" not in each.name]
    context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
    return names, [
        f"{each.GetValidator().GetMetadata().name} {each.GetName()}: {each.GetMessage()}"
        for each in context.Validate(stage)
    ]


def look(path):
    stage = Usd.Stage.Open(str(path))
    names, faults = faults_of(stage)
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


if sys.argv[2:] == ["--faults"]:
    for path in sorted(Path(sys.argv[1]).glob("*.usd")):
        print(faults_of(Usd.Stage.Open(str(path)))[1])
    sys.exit()
for path in sorted(Path(sys.argv[1]).glob("*.usd")):
    path.with_suffix(".json").write_text(json.dumps(look(path)), encoding="utf-8")
