"""SMPL-X parameters as npz, for research code and the SMPL-X add-ons. Only written; no prompt is in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.core.errors import InvalidInput
from marey.exporters.exporter import Coordinates, Exporter

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.export_options import ExportOptions
    from marey.motion.rigs.rigged import RiggedMotion


def encode(clip: MotionClip, coordinates: Coordinates) -> bytes:
    """Refuse: the parameters refer to the rest joints of a model that Marey may not ship.

    Raises:
        InvalidInput: always.
    """
    raise _needs_model(clip.skeleton.name)


def check(options: ExportOptions) -> None:
    """Validate that the rig is an SMPL-X model.

    Raises:
        InvalidInput: there is no rig, or another one.
        NotFound, InvalidFile, TooLarge: its file cannot be read.
    """
    if options.rig is None:
        raise _needs_model("smplx")
    from marey.motion.io.smplx_write import check_rig
    from marey.motion.retarget import load_body

    check_rig(load_body(options.rig, options.rig_map).rig)


def _needs_model(where: str) -> InvalidInput:
    return InvalidInput(
        "smplx files need the rest joints of the SMPL-X model, which Marey may not ship",
        where=where,
        hint="Get SMPLX_NEUTRAL.npz at https://smpl-x.is.tue.mpg.de, and name it as the rig: --rig SMPLX_NEUTRAL.npz.",
        argument="rig",
    )


def encode_rigged(motion: RiggedMotion, coordinates: Coordinates) -> bytes:
    """Write a motion on the rest joints of an SMPL-X model.

    Raises:
        InvalidInput: see `marey.motion.io.smplx_write.format_smplx`.
    """
    from marey.motion.io.smplx_write import format_smplx

    return format_smplx(motion)


EXPORTER: Exporter[MotionClip] = Exporter(
    format="smplx",
    media_type="application/x-npz",
    extension="smplx.npz",
    holds_prompt=False,
    encode=encode,
    options=frozenset({"in_place", "tpose_frame", "placement", "rig"}),
    encode_rigged=encode_rigged,
    stored=False,
    check=check,
)
