"""The BVH file that a live stream is written to while it runs. Writing needs the extra `motion`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from marey.client.frames import Frame
from marey.client.types.streams import StreamDetail
from marey.core.errors import InvalidInput
from marey.core.extras import extra

if TYPE_CHECKING:
    from marey.motion.io.bvh_live import LiveBVH


class Recording:
    """A BVH file that grows with the stream; row n is frame n, also across missing frames.

    Args:
        path: the file; it exists from the first frame on.
        overwrite: replace an existing file.

    Raises:
        InvalidInput: not a `.bvh`, or numpy is not installed.
        Conflict: it exists.
    """

    def __init__(self, path: Path, *, overwrite: bool) -> None:
        check_recording(path, overwrite=overwrite)
        self._path = path
        self._overwrite = overwrite
        self._file: LiveBVH | None = None

    @property
    def path(self) -> Path | None:
        """The absolute path of the file; None while it has no frame."""
        return self._path.absolute() if self._file is not None and self._file.frames else None

    def add(self, frame: Frame, stream: StreamDetail) -> None:
        """Write a frame, and before it the missing ones.

        Args:
            stream: with its skeleton.

        Raises:
            MareyError: the frame, the skeleton or the file cannot be used.
        """
        import numpy as np

        if self._file is None:
            self._file = self._open(stream)
        rotations, root = np.array(frame.rotations, np.float32), np.array(frame.root, np.float32)
        self._file.add(rotations, root, missing=frame.number - self._file.frames)

    def close(self) -> None:
        """Close the file; its path stays known."""
        if self._file is not None:
            self._file.close()

    def _open(self, stream: StreamDetail) -> LiveBVH:
        import numpy as np

        from marey.motion.io.bvh_live import LiveBVH
        from marey.motion.skeleton import skeleton_of

        where, tree = f"stream {stream.id}", stream.skeleton
        if tree is None or stream.fps is None:
            raise InvalidInput("the server describes no skeleton", where=where)
        try:
            skeleton = skeleton_of(tree.names, tree.parents, np.array(tree.offsets, np.float32))
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"the server's skeleton cannot be used: {error}", where=where) from error
        return LiveBVH.open(self._path, skeleton, stream.fps, overwrite=self._overwrite)


def check_recording(path: Path, *, overwrite: bool) -> None:
    """Validate that a stream can be written to a file.

    Raises:
        InvalidInput: not a `.bvh`, or numpy is not installed.
        Conflict: it exists.
    """
    if path.suffix.lower() != ".bvh":
        raise InvalidInput(
            "only a .bvh can grow with a stream",
            where=str(path),
            hint="Fetch the other formats from the stream's job after its end.",
        )
    with extra("motion"):
        from marey.motion.io.bvh_live import check_place
    check_place(path, overwrite=overwrite)
