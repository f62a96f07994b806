"""glb (glTF 2.0, binary): skeleton, skin, motion and manifest, prompt included."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates, Exporter
from marey.exporters.prepare import with_body

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.rigs.rigged import RiggedMotion


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Write a glb: always in metres, Y up.

    Raises:
        InvalidInput: see `marey.motion.io.glb_write.write_glb`.
    """
    from marey.motion.io.glb_write import format_glb

    posed, body = with_body(clip, coordinates)
    return format_glb(posed, coordinates, body)


def encode_rigged(motion: RiggedMotion, coordinates: Coordinates) -> bytes:
    """Write a motion on a rig: always in metres, Y up.

    Raises:
        InvalidInput: see `marey.motion.io.rigged_glb.format_rigged_glb`.
    """
    from marey.motion.io.rigged_glb import format_rigged_glb

    return format_rigged_glb(motion, options=coordinates)


def decode(data: bytes, where: str, coordinates: Coordinates) -> MotionClip:
    """Read a glb that Marey wrote; its features are not in it.

    Raises:
        InvalidFile: see `marey.motion.io.glb_read.read_glb`.
    """
    from marey.motion.io.glb_read import parse_glb

    return parse_glb(data, where)


EXPORTER = Exporter(
    format="glb",
    media_type="model/gltf-binary",
    extension="glb",
    holds_prompt=True,
    encode=encode,
    decode=decode,
    options=frozenset({"root_bone", "in_place", "tpose_frame", "placement", "mesh", "rig", "rig_map", "names"}),
    encode_rigged=encode_rigged,
    stored=False,
)
