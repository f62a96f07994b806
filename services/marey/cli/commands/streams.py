"""`marey stream`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from marey.cli import console, options
from marey.core.errors import MareyError, NotFound

if TYPE_CHECKING:
    from marey.cli.live.steering import Interrupts
    from marey.client import Client, LiveStream

COLUMNS = ("stream", "job", "state", "frames", "fps", "gaps", "file")


def stream(
    prompt: Annotated[str, typer.Argument(metavar="PROMPT", help="What the person does first.")],
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="Maximum length in seconds; default: the server's, 10 minutes.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Seed; default: random.")] = None,
    model: Annotated[
        str | None, typer.Option("--model", help="Model, bundle or exact bundle; default: the server's.")
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="A name for the stream and its clip.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="A .bvh that grows while the stream runs.")
    ] = None,
    slow: Annotated[
        Literal["skip", "pause"],
        typer.Option("--slow", help="If this client cannot keep up: skip frames, or pause the stream."),
    ] = "skip",
    fetch: Annotated[
        Path | None,
        typer.Option("--fetch", help="Wait for the clip after the end, and fetch its files into this folder."),
    ] = None,
    end_pose: Annotated[
        str | None,
        typer.Option(
            "--end-pose",
            metavar="MOTION:FRAME",
            help="When you stop the stream, let it end on this frame of an npz file or of a motion of the server.",
        ),
    ] = None,
    overwrite: options.Overwrite = False,
    as_json: console.Json = False,
) -> None:
    """Watch motion while it is generated, and steer it.

    A line on stdin is the next action of the person; /pause, /resume and /stop control the stream. The end of stdin
    has no effect. Ctrl-C stops the stream, waits for its end and exits with 130; a second one exits at once.

    The line that counts shows frames a second over the last two seconds, and the latency: the age of the newest frame
    on an even clock of 20 frames a second, set by the frame that came earliest. It is below 50 ms as long as no time is
    lost on the way; `buffered` counts frames that arrived and are not written yet, `gaps` those that never came.

    The BVH is whole at every moment, however the program ends, and row n is frame n: missing frames are made of their
    neighbours, by slerp and lerp. The clip that --fetch brings has all frames.
    """
    from marey.cli.live.steering import Interrupts

    if fetch is not None:
        from marey.client.fetching import check_folder

        check_folder(fetch, hint="Choose another folder for --fetch.")  # before anything begins
    if output is not None:
        from marey.client.recording import check_recording

        check_recording(output, overwrite=overwrite)
    from marey.cli.live.end_pose import read_end_pose
    from marey.client import Client

    with Client() as client:
        pose = None if end_pose is None else read_end_pose(client, end_pose)
        with Interrupts() as interrupts:
            live = client.streams.open(
                prompt, model=model, seed=seed, seconds=seconds, name=name, slow=slow, record=output,
                overwrite=overwrite,
            )  # fmt: skip
            result, error = _follow(live, interrupts, pose, as_json=as_json)
        _write_result(result, as_json=as_json)
        if error is not None:
            raise error
        if interrupts.count:
            if fetch is not None and result["job"] is not None:
                console.say(f"Not fetched; `marey fetch {result['job']} -o {fetch}` does it.")
            raise KeyboardInterrupt
        if fetch is not None:
            _fetch(client, result, fetch, overwrite=overwrite, as_json=as_json)


def _follow(
    live: LiveStream, interrupts: Interrupts, pose: Mapping[str, Any] | None, *, as_json: bool
) -> tuple[dict[str, Any], MareyError | None]:
    """Follow a stream to its end; return its output line, and its error, which does not undo what arrived before."""
    from marey.cli.live.follow import Follower

    follower = Follower(live, interrupts, pose=pose, as_json=as_json)
    try:
        follower.run()
    except MareyError as error:
        return follower.result(), error
    return follower.result(), live.failure()


def _write_result(result: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        console.result_json({"type": "end", **result})
        return
    if result["gaps"]:
        console.say(f"{result['gaps']} of {result['frames']} frames did not come" + _filled(result))
    shown = {**result, "file": result["file"] and console.home_relative(result["file"])}
    console.table(COLUMNS, [[shown[column] for column in COLUMNS]])


def _filled(result: dict[str, Any]) -> str:
    return "; in the file they are interpolated." if result["file"] else "."


def _fetch(client: Client, result: dict[str, Any], folder: Path, *, overwrite: bool, as_json: bool) -> None:
    from marey.cli.commands.fetch import write_job
    from marey.cli.watching import check_ended, watch_job

    if result["job"] is None:
        raise NotFound("no clip to fetch: nothing was recorded", where=f"stream {result['stream']}")
    ended = watch_job(client, result["job"])
    write_job(client, result["job"], folder, None, overwrite=overwrite, as_json=as_json)
    check_ended(ended)
