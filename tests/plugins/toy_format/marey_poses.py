"""Export motions as one JSON object, `.pose`: skeleton, rotations, root and the manifest, which holds the prompt."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from marey.core.errors import InvalidFile
from marey.exporters import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Write a clip; equal clips give equal bytes."""
    values = {
        "names": list(clip.skeleton.joint_names),
        "parents": list(clip.skeleton.parents),
        "offsets": clip.offsets.tolist(),
        "rotations": clip.rotations.tolist(),
        "root": clip.root.tolist(),
        "contacts": clip.contacts.tolist(),
        "fps": clip.fps,
        "manifest": dict(clip.manifest),
    }
    return json.dumps(values, sort_keys=True, ensure_ascii=False).encode()


def decode(data: bytes, where: str, coordinates: Coordinates) -> MotionClip:
    """Read a clip.

    Raises:
        InvalidFile: not a file of this format.
    """
    import numpy as np

    from marey.motion.clip import MotionClip
    from marey.motion.skeleton import skeleton_of

    try:
        values = json.loads(data)
        skeleton = skeleton_of(
            tuple(values["names"]), tuple(values["parents"]), np.array(values["offsets"], np.float32)
        )
        return MotionClip.of(
            skeleton,
            np.array(values["rotations"], np.float32),
            np.array(values["root"], np.float32),
            np.array(values["contacts"], bool),
            values["fps"],
            manifest=values["manifest"],
        )
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidFile(f"not a file of poses: {error}", where=where) from error


EXPORTER = Exporter(
    format="poses",
    media_type="application/json",
    extension="pose",
    holds_prompt=True,
    encode=encode,
    decode=decode,
)
