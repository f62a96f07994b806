"""Edits of motion files, for `marey edit`."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.core.errors import Conflict, InvalidInput
from marey.core.extras import extra
from marey.motion.export_options import ExportOptions

if TYPE_CHECKING:
    from marey.exporters import Exporter
    from marey.motion.clip import MotionClip
    from marey.motion.edits.editing import EditSource, FrameModel
    from marey.vocabulary.scope import ScopePolicy


def edit_files(
    sources: Sequence[Path],
    output: Path,
    ops: Sequence[Mapping[str, Any]],
    *,
    model: FrameModel | None = None,
    file_format: str,
    export: ExportOptions,
    overwrite: bool,
) -> Iterator[dict[str, Any]]:
    """Edit motion files, and yield a line for each file that was written. All are edited before the first is written.

    Args:
        sources: files that `marey convert` reads.
        output: a motion file, or a folder.
        ops: as of `marey.motion.edit`; files in `with` are read like the sources.
        model: see `model_for`.
        file_format: of files in a folder.
        export: options of the files.
        overwrite: replace existing files.

    Raises:
        InvalidInput: an operation that is unknown or cannot be done, several sources for one file, or a format that is
            unknown.
        Conflict: a file exists.
        NotFound, InvalidFile, TooLarge: of a source.
    """
    with extra("motion"):
        from marey.editing.judge import judged
        from marey.exporters import Coordinates, check_writers
        from marey.motion.edits.editing import edit
        from marey.motion.files import write_atomically
    writer, is_file = _writer(output, file_format)
    if is_file and len(sources) > 1:
        raise InvalidInput(f"is one file for {len(sources)} motions", where=str(output), hint="Name a folder with -o.")
    check_writers([writer], export)
    made: list[tuple[Path, Path, MotionClip]] = []
    for source in sources:
        try:
            clips = edit(_read(source), ops, load=lambda name: _read(Path(name)), model=model)
        except InvalidInput as error:
            if len(sources) > 1:
                error.where = f"{source}: {error.where}" if error.where else str(source)
            raise
        target = output if is_file else output / f"{source.stem}.{writer.extension}"
        made += [(source, path, judged(clip)) for path, clip in zip(_numbered(target, len(clips)), clips, strict=True)]
    _check_targets([path for _, path, _ in made], overwrite=overwrite)
    for source, path, clip in made:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInput(f"cannot write here: {error.strerror}", where=str(path.parent)) from error
        write_atomically(path, writer.write(clip, Coordinates.of(export)))
        yield _line(source, path, clip)


def model_for(
    ops: Sequence[Mapping[str, Any]], bundle: str | None, settings: Mapping[str, float], scope: ScopePolicy = "warn"
) -> tuple[FrameModel | None, Sequence[str]]:
    """Load the model of operations, None if they need none; return it with warnings of prompts that it does not know.

    Args:
        ops: as of `marey.motion.edit`.
        bundle: model, bundle or folder; None = the default model.
        settings: of sampling.
        scope: prompts with actions that the model does not know: warned of, refused, or not examined.

    Raises:
        OutOfScope: such prompts, with scope `refuse`.
        InvalidInput: an unknown operation or setting, or a model that cannot generate frames around others.
        NotFound, InvalidBundle: of the bundle.
    """
    from marey.motion.edits.steps import prompts_of_steps, read_steps

    steps = read_steps(ops)
    if not any(step.operation.needs_model for step in steps):
        return None, ()
    with extra("worker"):
        from marey.bundles import choose_bundle
        from marey.bundles.limits import edit_settings
        from marey.bundles.scope import examine_prompts
        from marey.core.settings import settings as settings_of_process
        from marey.generate.oneshot import OneShot
    config = settings_of_process()
    chosen = choose_bundle(bundle or config.default_model, config=config)
    given, prompts = edit_settings(chosen, settings), prompts_of_steps(steps)
    if prompts and scope == "refuse":
        examine_prompts(prompts, chosen, scope)  # by words, before the model is loaded
    studio = OneShot(chosen, config)
    report = examine_prompts(prompts, chosen, scope, match=studio.match_scope) if prompts else None
    return studio.editor(given), () if report is None else report.warnings()


def loop(clip: MotionClip, where: str) -> MotionClip:
    """Cut a cycle out of a generated motion, and judge it anew.

    Args:
        where: prompt and seed, for messages.

    Raises:
        InvalidInput: it holds no cycle that can be played on.
    """
    from marey.editing.judge import judged
    from marey.motion.edits.editing import edit

    try:
        (cycle,) = edit(clip, [{"op": "loop"}])
    except InvalidInput as error:
        raise InvalidInput(
            error.message, where=where, hint="Try another seed or a longer motion, or leave out --loop."
        ) from error
    return judged(cycle)


def _writer(output: Path, file_format: str) -> tuple[Exporter[Any], bool]:
    """Return the exporter of the results, and whether the output names one file."""
    from marey.exporters import check_known, exporter_named, exporters

    named = exporter_named(output.name)
    if named is not None and not output.is_dir():
        return named, True
    check_known([file_format])
    return exporters()[file_format], False


def _read(path: Path) -> EditSource:
    from marey.exporters import Coordinates
    from marey.exporters.convert import read_motion
    from marey.motion.clip import MAX_UNPACKED
    from marey.motion.edits.editing import EditSource
    from marey.motion.files import read_limited

    clip = read_motion(path, Coordinates())
    return EditSource(clip, path.name, hashlib.sha256(read_limited(path, MAX_UNPACKED)).hexdigest())


def _numbered(target: Path, count: int) -> list[Path]:
    """Return the paths of the pieces of a motion."""
    if count == 1:
        return [target]
    return [target.with_name(f"{target.stem}-{number}{target.suffix}") for number in range(1, count + 1)]


def _check_targets(paths: Sequence[Path], *, overwrite: bool) -> None:
    if len(set(paths)) < len(paths):
        twice = next(path for path in paths if paths.count(path) > 1)
        raise InvalidInput("two motions would have this name", where=str(twice), hint="Edit them into other folders.")
    for path in paths:
        if path.exists() and not overwrite:
            raise Conflict("already exists", where=str(path), hint="Choose another name, or --overwrite.")


def _line(source: Path, path: Path, clip: MotionClip) -> dict[str, Any]:
    about = clip.manifest
    shown = ("placement", "loop", "travel", "travel_per_second", "licence", "edited_from")
    return {
        "source": str(source),
        "file": str(path.absolute()),
        "frames": clip.frames,
        "fps": clip.fps,
        "quality": about.get("quality"),
        **{name: about[name] for name in shown if name in about},
    }
