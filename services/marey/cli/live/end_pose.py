"""`--end-pose` of `marey stream`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.cli.references import find
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    from marey.client import Client

OPTION = "--end-pose"


def read_end_pose(client: Client, text: str) -> dict[str, Any]:
    """Return the pose of `MOTION:FRAME`, before the stream begins: of a file, which is read here, or of a motion of the
    server.

    Raises:
        InvalidInput: another form, or a frame that the motion does not have.
        NotFound: there is no such file or motion.
    """
    name, colon, frame = text.rpartition(":")
    if not (name and colon and frame.isascii() and frame.isdecimal() and len(frame) < 10):
        raise InvalidInput(f"{text[:60]!r} is not MOTION:FRAME", where=OPTION, hint="Example: bow.npz:40.")
    number = int(frame)
    if Path(name).suffix == ".npz" or Path(name).exists():
        from marey.motion.keyframes import PoseFiles

        given = {"motion": {"file": name, "frame": number}}
        try:
            (pose,) = PoseFiles(Path()).fill([given])
        except InvalidInput as error:
            raise InvalidInput(error.message, where=OPTION, hint=error.hint) from None
        return pose
    from marey.motion.keyframes import beyond

    motion = client.motions.get(find(client, "motion", name).id)
    if number >= motion.frames:
        raise InvalidInput(beyond(number, motion.frames), where=OPTION)
    return {"motion": {"id": motion.id, "frame": number}}
