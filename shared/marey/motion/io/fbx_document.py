"""The objects of an FBX file and what stands around them: header, settings, connections, takes."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable
from functools import lru_cache

from marey.motion.io.fbx_nodes import (
    CREATION_TIME,
    FILE_ID,
    SEPARATOR,
    TICKS,
    VERSION,
    FbxNode,
    Long,
    Property,
    encode,
    node,
)
from marey.motion.io.fbx_templates import definitions, prop
from marey.motion.units import Up

CREATOR = "Marey"
TAKE = "motion"
TIME_MODES = {
    120.0: 1, 100.0: 2, 60.0: 3, 50.0: 4, 48.0: 5, 30.0: 6, 30000 / 1001: 9, 25.0: 10, 24.0: 11, 1000.0: 12,
    24000 / 1001: 13, 96.0: 15, 72.0: 16, 60000 / 1001: 17, 120000 / 1001: 18,
}  # fmt: skip
"""Number of each frame rate that has one (FbxTime::EMode)."""
CUSTOM = 14
AXES: dict[Up, tuple[tuple[int, int], ...]] = {"y": ((1, 1), (2, 1), (0, 1)), "z": ((2, 1), (1, -1), (0, 1))}
"""Axis and sign of up, front and the third direction. Front is where the camera stands: the body faces it."""


def time_mode(fps: float) -> tuple[int, float]:
    """Return the number of a rate, and the rate that a file states beside it: -1 where the number says it."""
    for rate, mode in TIME_MODES.items():
        if abs(fps - rate) < 1e-4 * rate / 1001:
            return mode, -1.0
    return CUSTOM, fps


def ticks(frame: int, fps: float) -> Long:
    """Return the time of a frame in units of the format."""
    return Long(round(frame * TICKS / fps))


@lru_cache(maxsize=4096)  # the files of many motions on one rig have the same objects
def _identifier(key: tuple[object, ...]) -> Long:
    digest = hashlib.sha256(repr(key).encode()).digest()
    return Long(int.from_bytes(digest[:8], "little") >> 12)


class FbxDocument:
    """Objects and connections of a file; identifiers are hashes, so that equal input gives equal bytes."""

    def __init__(self) -> None:
        self._objects: list[FbxNode] = []
        self._connections: list[FbxNode] = []
        self._taken = {0}

    def identifier(self, *key: object) -> Long:
        """Return the identifier of a key: 52 bits, since readers in JavaScript keep no more."""
        for attempt in range(2**10):
            number = _identifier((*key, attempt))
            if number not in self._taken:
                self._taken.add(number)
                return number
        raise AssertionError("1,024 collisions")

    def add(
        self, kind: str, name: str, label: str, sub: str, below: Iterable[FbxNode], *, number: Long | None = None
    ) -> Long:
        """Add an object and return its identifier.

        Args:
            kind: type of the object, such as `Model`.
            name: its name.
            label: its class, such as `AnimCurve` where that differs from the type.
            sub: its sub-class, such as `LimbNode`.
            below: its contents.
            number: an identifier that was made before.
        """
        if number is None:
            number = self.identifier(kind, name, len(self._objects))
        self._objects.append(node(kind, number, f"{name}{SEPARATOR}{label}", sub, below=tuple(below)))
        return number

    def connect(self, child: Long, parent: int, attribute: str | None = None) -> None:
        """Connect an object with its parent (0 = the scene), or with an attribute of it."""
        if attribute is None:
            self._connections.append(node("C", "OO", child, Long(parent)))
        else:
            self._connections.append(node("C", "OP", child, Long(parent), attribute))

    def encode(self, *, fps: float, frames: int, unit: float, up: Up) -> bytes:
        """Return the bytes of the file; its unit is given in metres."""
        end = ticks(frames - 1, fps)
        counts = Counter(each.name for each in self._objects)
        return encode([
            *_header(),
            _settings(fps, end, unit, up),
            _documents(self.identifier("Document")),
            node("References", block=True),
            definitions(counts),
            node("Objects", below=self._objects),
            node("Connections", below=self._connections),
            _takes(end),
        ])  # fmt: skip


def _header() -> list[FbxNode]:
    """Return the nodes about the file itself. There is no clock in it."""
    moments = (("Year", 1970), ("Month", 1), ("Day", 1), ("Hour", 10), ("Minute", 0), ("Second", 0), ("Millisecond", 0))
    names = ("Title", "Subject", "Author", "Keywords", "Revision", "Comment")
    meta = [node("Version", 100), *(node(name, "") for name in names)]
    programs: list[FbxNode] = []
    for time in ("Original", "LastSaved"):
        programs.append(prop(time, "compound", ()))
        programs += [prop(f"{time}|Application{key}", "string", value)
                     for key, value in (("Vendor", CREATOR), ("Name", CREATOR), ("Version", "1"))]  # fmt: skip
    scene = [
        node("Type", "UserData"),
        node("Version", 100),
        node("MetaData", below=meta),
        node("Properties70", below=programs),
    ]
    below = [
        node("FBXHeaderVersion", 1003),
        node("FBXVersion", VERSION),
        node("EncryptionType", 0),
        node("CreationTimeStamp", below=[node("Version", 1000), *(node(name, value) for name, value in moments)]),
        node("Creator", CREATOR),
        node("SceneInfo", f"GlobalInfo{SEPARATOR}SceneInfo", "UserData", below=scene),
    ]
    return [
        node("FBXHeaderExtension", below=below),
        node("FileId", FILE_ID),
        node("CreationTime", CREATION_TIME),
        node("Creator", CREATOR),
    ]


def _settings(fps: float, end: Long, unit: float, up: Up) -> FbxNode:
    """Return axes, unit and rate of the file."""
    mode, rate = time_mode(fps)
    scale = float(f"{unit * 100:.9g}")  # in centimetres
    rows: list[FbxNode] = []
    for name, (axis, sign) in zip(("UpAxis", "FrontAxis", "CoordAxis"), AXES[up], strict=True):
        rows += [prop(name, "int", (axis,)), prop(f"{name}Sign", "int", (sign,))]
    rows += [
        prop("OriginalUpAxis", "int", (AXES[up][0][0],)),
        prop("OriginalUpAxisSign", "int", (1,)),
        prop("UnitScaleFactor", "double", (scale,)),
        prop("OriginalUnitScaleFactor", "double", (scale,)),
        prop("AmbientColor", "color", (0, 0, 0)),
        prop("DefaultCamera", "string", "Producer Perspective"),
        prop("TimeMode", "enum", (mode,)),
        prop("TimeProtocol", "enum", (2,)),
        prop("SnapOnFrameMode", "enum", (0,)),
        prop("TimeSpanStart", "time", (0,)),
        prop("TimeSpanStop", "time", (end,)),
        prop("CustomFrameRate", "double", (rate,)),
        prop("TimeMarker", "compound", ()),
        prop("CurrentTimeMarker", "int", (-1,)),
    ]
    return node("GlobalSettings", below=[node("Version", 1000), node("Properties70", below=rows)])


def _documents(number: Long) -> FbxNode:
    rows = [prop("SourceObject", "object", ()), prop("ActiveAnimStackName", "string", TAKE)]
    inner = node("Document", number, "", "Scene", below=[node("Properties70", below=rows), node("RootNode", Long(0))])
    return node("Documents", below=[node("Count", 1), inner])


def _takes(end: Long) -> FbxNode:
    span: tuple[Property, ...] = (Long(0), end)
    below = [node("FileName", f"{TAKE}.tak"), node("LocalTime", *span), node("ReferenceTime", *span)]
    return node("Takes", below=[node("Current", TAKE), node("Take", TAKE, below=below)])
