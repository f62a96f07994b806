"""The BVH file that a live stream is recorded to while it is made. Writing needs the extra `motion`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.client.frames import read_frame
from marey.core.errors import InvalidInput
from marey.core.extras import needs_extra

if TYPE_CHECKING:
    from marey.motion.io.bvh_live import LiveBVH


class Recording:
    """The BVH file that grows with the stream; row n is frame n, also across gaps.

    Args:
        path: the file; it is there from the first frame on.

    Raises:
        InvalidInput: not a `.bvh`, or numpy is not installed.
        Conflict: it is there already.
    """

    def __init__(self, path: Path, *, overwrite: bool) -> None:
        if path.suffix.lower() != ".bvh":
            hint = "--fetch brings the other formats when the stream is over."
            raise InvalidInput("only a .bvh can grow while it is made", where=str(path), hint=hint)
        try:
            from marey.motion.io.bvh_live import check_place
        except ImportError as error:
            raise needs_extra("motion", error) from error
        check_place(path, overwrite=overwrite)
        self._path = path
        self._overwrite = overwrite
        self._file: LiveBVH | None = None

    @property
    def path(self) -> Path | None:
        """The file; None while it has no frame."""
        return self._path.absolute() if self._file is not None and self._file.frames else None

    def add(self, data: bytes, stream: Mapping[str, Any]) -> None:
        """Write a frame.

        Args:
            data: the frame.
            stream: the stream as the server describes it, with its skeleton.

        Raises:
            MareyError: the frame, the skeleton or the file cannot be used.
        """
        import numpy as np

        if self._file is None:
            self._file = self._open(stream)
        frame = read_frame(data, joints=len(self._file.skeleton))
        rotations, root = np.array(frame.rotations, np.float32), np.array(frame.root, np.float32)
        self._file.add(rotations, root, missing=frame.number - self._file.frames)

    def close(self) -> None:
        """Nothing more comes."""
        if self._file is not None:
            self._file.close()

    def _open(self, stream: Mapping[str, Any]) -> LiveBVH:
        import numpy as np

        from marey.motion.io.bvh_live import LiveBVH
        from marey.motion.skeleton import skeleton_of

        try:
            tree = stream["skeleton"]
            parents = tuple(int(parent) for parent in tree["parents"])
            offsets = np.array(tree["offsets"], np.float32)
            skeleton = skeleton_of(tuple(str(name) for name in tree["names"]), parents, offsets)
            return LiveBVH.open(self._path, skeleton, float(stream["fps"]), overwrite=self._overwrite)
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInput(
                f"the server describes no skeleton: {error!r}", where=f"stream {stream['id']}"
            ) from error
