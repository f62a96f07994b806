"""Parts, other joints and properties of a rig, as JSON."""

from __future__ import annotations

from typing import Any

from marey.motion.rigs.body import RigBody


def describe(body: RigBody) -> dict[str, Any]:
    """Return what is known of a rig, as JSON: sizes in metres."""
    rig, found = body.rig, body.map
    return {
        "name": rig.name,
        "sha256": rig.sha256,
        "family": found.family,
        "pose": "standing" if body.standing else "not standing: limbs are turned by their directions alone",
        "leg": round(body.leg, 4),
        "unit": rig.unit,
        "up": rig.up,
        "root": None if found.root is None else rig.joint_names[found.root],
        "notes": list(rig.notes),
        "parts": {
            part: {"joint": rig.joint_names[joint], "how": found.how[part]} for part, joint in found.parts.items()
        },
        "others": {
            name: _role(body, joint) for joint, name in enumerate(rig.joint_names) if joint not in found.parts.values()
        },
    }


def _role(body: RigBody, joint: int) -> str:
    """Return what becomes of a joint that is no part of the body."""
    found = body.map
    if joint in found.twists:
        twist = found.twists[joint]
        return f"twist of {twist.bone[0]}, {twist.share:.0%}"
    if joint in found.follows:
        return f"follows {found.follows[joint]}"
    if joint == found.root:
        return "root"
    return "control or end" if joint in found.controls else "keeps its rest pose"
