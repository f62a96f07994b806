"""A process that makes files, and reads rigs and poses: `python -m marey.api.making.child SECONDS BYTES` reads
requests from stdin until its end.

It has neither a database nor a store: the API sends the npz or the file of the rig, and gets the result back.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from marey.api.making.messages import read_message, write_message
from marey.core.characters import check_text
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError, TooLarge
from marey.core.extras import MissingExtra, extra
from marey.core.memory import limit_memory
from marey.exporters.making import FileRecipe, RigFile
from marey.motion.export_options import ExportOptions

NICENESS = 5
"""Behind the API, which answers others meanwhile."""
MAX_FILE = 64 * 2**20
"""Bytes of a file."""
MAX_REPORT = 2**20
"""Bytes of what is found in a rig; two thousand joints with long names take a quarter of it."""


def main(seconds: int, memory: int) -> None:
    """Answer requests.

    Args:
        seconds: of one file; then the process ends by SIGALRM.
        memory: bytes of memory.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the group; the end of stdin ends this process
    os.nice(NICENESS)
    limit_memory(memory)
    with suppress(OSError):  # where memory runs out, Linux ends this process before the API
        Path("/proc/self/oom_score_adj").write_text("1000")
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what an exporter prints is no answer
    with suppress(EOFError, BrokenPipeError):
        while True:
            request, content = read_message(requests)
            signal.alarm(seconds)
            _answer(answers, request, content)
            signal.alarm(0)


def _answer(answers: BinaryIO, request: dict[str, Any], content: bytes) -> None:
    answer, problem = TASKS[request["task"]]
    try:
        result = answer(request, content)
    except MemoryError:
        error: MareyError = TooLarge("the file takes more memory than this server gives")
        write_message(answers, problem(error, request))
    except MareyError as error:
        write_message(answers, problem(error, request))
    except Exception:
        traceback.print_exc()
        write_message(answers, {"type": MareyError.problem_type, "message": "an internal error"})
    else:
        write_message(answers, {}, result)


def _make(request: dict[str, Any], sources: bytes) -> bytes:
    """Return the file of an npz, which the file of a rig may follow."""
    rig = None if request["rig"] is None else RigFile(**request["rig"])
    recipe = FileRecipe(request["format"], ExportOptions(**request["options"]), request["fps"], rig)
    npz = request["npz"]
    content = recipe.make(sources[:npz], request["where"], sources[npz:])
    if len(content) > MAX_FILE:
        raise TooLarge(f"the file would have {len(content) / 2**20:.0f} MiB, over {MAX_FILE // 2**20}")
    return content


def _report(request: dict[str, Any], data: bytes) -> bytes:
    """Return what is found in a rig, as JSON that the database can hold."""
    with extra("motion"):
        from marey.motion.retarget.load import parse_body
        from marey.motion.rigs.read import READERS
        from marey.motion.rigs.report import describe
    if request["format"] not in READERS:
        raise InvalidInput("is not a rig format", where="format", hint=f"Known: {', '.join(READERS)}.")
    body = parse_body(data, f"{request['name']}.{request['format']}", request["map"])
    for joint in body.rig.joint_names:
        check_text(joint, subject="the name of a joint", where="body")
    report = json.dumps(describe(body), allow_nan=False).encode()
    if len(report) > MAX_REPORT:
        raise TooLarge("its joints have names that are too long", hint="Export the skeleton with shorter names.")
    return report


def _poses(request: dict[str, Any], npz: bytes) -> bytes:
    """Return frames of an npz as JSON: fields of pose keyframes, in the order asked for."""
    with extra("motion"):
        from marey.motion.clip import parse_npz
        from marey.motion.keyframes import beyond, pose_of
    clip = parse_npz(npz, request["where"])
    for frame in request["frames"]:
        if frame >= clip.frames:
            raise InvalidInput(beyond(frame, clip.frames))
    return json.dumps([pose_of(clip, frame) for frame in request["frames"]], allow_nan=False).encode()


def _pose_problem(error: MareyError, request: dict[str, Any]) -> dict[str, Any]:
    """Describe why poses cannot be read, without a word of this machine."""
    if isinstance(error, MissingExtra):
        error = InvalidInput("this server reads no poses", hint=f"Ask its operator for the extra {error.extra!r}.")
    elif isinstance(error, InvalidFile):
        error = Conflict(f"the npz of the motion cannot be read: {error.message}")
    return {"type": error.problem_type, "message": error.message, "where": request["where"], "hint": error.hint}


def _rig_problem(error: MareyError, request: dict[str, Any]) -> dict[str, Any]:
    """Describe why a rig cannot be read, by the field of the request that is wrong."""
    where = error.where if error.where in ("format", "map") else "body"
    if isinstance(error, MissingExtra):
        hint = f"Ask its operator for the extra {error.extra!r}."
        of = f" in {request['format']}" if error.extra == "usd" else ""
        error = InvalidInput(f"this server reads no rigs{of}", hint=hint)
    return {"type": error.problem_type, "message": error.message, "where": where, "hint": error.hint}


def _problem(error: MareyError, request: dict[str, Any]) -> dict[str, Any]:
    """Describe an error for the API's client: in terms of the request, never of this machine."""
    if isinstance(error, MissingExtra):
        hint = f"Ask its operator for the extra {error.extra!r}, or make the file where you have it: `marey convert`."
        error = InvalidInput(f"this server makes no {request['format']} files", where="format", hint=hint)
    elif isinstance(error, InvalidFile) and error.where == request["where"]:
        error = Conflict(f"the npz of the motion cannot be read: {error.message}", where=request["where"])
    elif isinstance(error, InvalidFile) and error.argument == "body":
        error = InvalidInput(error.message, where="body", hint="Add the character in the size of a person.")
    elif isinstance(error, InvalidFile):  # an upgrade may change what is read
        hint = "Add it again: marey rigs add."
        error = Conflict(f"the rig cannot be read: {error.message}", where="rig", hint=hint, argument="body")
    known = {*request["options"], "fps", request["where"]}
    where = next((each for each in (error.where, error.argument) if each in known), "format")
    return {"type": error.problem_type, "message": error.message, "where": where, "hint": error.hint}


TASKS = {"make": (_make, _problem), "report": (_report, _rig_problem), "poses": (_poses, _pose_problem)}
"""Answer of each task, and the description of its errors."""

if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
