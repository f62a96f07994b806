"""`marey generate`: prompts to files in this process, without a server."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.cli import console, options
from marey.cli.commands.submit import read_prompts, report_gaps, row_defaults
from marey.cli.exporting import GeneratedBody, with_export
from marey.client import rows
from marey.client.names import FileNames, Naming, check_template, slug
from marey.core.errors import Conflict, InvalidBundle, InvalidInput, MareyError
from marey.core.extras import needs_extra
from marey.items.item import Item
from marey.items.problems import Problem
from marey.items.timeline import prompts_with_rows
from marey.items.values import MAX_SEED
from marey.motion.export_options import PLAIN, STANDARD, ExportOptions

OFF_PROMPT = "off-prompt"
"""The flag of a motion that does not show its prompt; see docs/reference/quality.md."""
SHOWN = 0.5
"""The match from which on a row of a timeline shows its prompt."""
CONSTRAINT_MISSED, POSTURE_JUMP = "constraint-missed", "posture-jump"
PART_LEFT_OUT = "part-left-out"
SAID_APART = (OFF_PROMPT, CONSTRAINT_MISSED, POSTURE_JUMP, PART_LEFT_OUT)
"""Flags that have sentences of their own."""

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.cli.roles.generating import OneShot, Wanted
    from marey.core.settings import Settings
    from marey.exporters import Exporter
    from marey.motion.body import NamedBody
    from marey.motion.clip import MotionClip
    from marey.vocabulary.scope import ScopePolicy


@dataclass(frozen=True)
class Planned:
    """One motion to make: prompt times variant."""

    item: Item
    variant: int
    wanted: Wanted
    paths: dict[str, Path]
    """The path of each format."""


@with_export(instead={"body": GeneratedBody})
def generate(
    prompts: options.Prompts = None,
    timelines: options.Timelines = None,
    file: options.PromptFile = None,
    input_format: options.PromptFormat = None,
    extra_columns: options.Extra = "refuse",
    model: options.Model = None,
    bundle: options.BundleOrFolder = None,
    seconds: options.Seconds = None,
    seed: options.Seed = None,
    variants: options.Variants = None,
    fps: options.Fps = None,
    best_of: options.BestOf = None,
    redraws: options.Redraws = None,
    variety: options.Variety = None,
    tags: options.Tags = None,
    sampling: options.Sampling = None,
    scope: options.Scope = "warn",
    loop: options.Loop = False,
    constraints: options.Constraints = None,
    formats: options.Formats = None,
    export: ExportOptions = PLAIN,
    output: options.Folder = Path(),
    name_template: options.Template = options.TEMPLATE,
    overwrite: options.Overwrite = False,
    as_json: console.Json = False,
) -> None:
    """Generate motions in this process, without a server or a queue."""
    from marey.cli.roles.generating import OneShot
    from marey.cli.roles.generating import read_file as read_constraints_file
    from marey.client.fetching import check_folder, make_folders

    check_template(name_template)
    kinds = _exporters(formats, export)
    defaults = row_defaults(
        sampling,
        model=model,
        seconds=seconds,
        seed=seed,
        variants=variants,
        fps=fps,
        best_of=best_of,
        redraws=redraws,
        variety=variety,
        tags=tags,
    )
    reader = read_prompts(prompts, file, input_format, defaults, extra_columns, timelines)
    items = list(report_gaps(reader))
    chosen, config = _bundle_for(reader, items, bundle)
    shaped = _body_of(chosen, export)
    if export.body is not None:  # motions are solved onto it: files have it already
        export = replace(export, body=None, rig_map=None)
    if scope == "refuse":
        _refuse(reader, items, chosen)
    planned = _plan(items, chosen, output, name_template, kinds, read_constraints_file(constraints))
    check_folder(output, hint="Choose another folder with -o.")
    make_folders(output, (path for plan in planned for path in plan.paths.values()))
    studio = OneShot(chosen, config, body=shaped)
    _examine(reader, items, studio, scope)
    if chosen.manifest.random:
        console.say(f"{chosen.manifest.name} has random weights: the motions show the machinery, not the prompts.")
    _make(studio, planned, export, loop=loop, overwrite=overwrite, as_json=as_json)


def _make(
    studio: OneShot,
    planned: Sequence[Planned],
    export: ExportOptions,
    *,
    loop: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Make the motions, and write and report each when it is there."""
    from marey.cli.roles.editing import loop as loop_clip

    with console.bar() as bar:
        task = bar.add_task("generating", total=len(planned))
        made = studio.make([plan.wanted for plan in planned])
        for plan, (wanted, clip, elapsed) in zip(planned, made, strict=True):
            result = loop_clip(clip, f"{wanted.prompt!r}, seed {wanted.seed}") if loop else clip
            line = _write(plan, result, elapsed, studio.bundle, export, overwrite=overwrite)
            bar.advance(task)
            _report(line, clip, as_json=as_json)


def _body_of(bundle: Bundle, export: ExportOptions) -> NamedBody | None:
    """Return the body that `--body` names, None for the standard one; it is read before the bundle is loaded."""
    from marey.bundles.body import read_body_for

    if export.body is None or export.body == STANDARD:
        return None
    return read_body_for(bundle.manifest, export.body, export.rig_map)


def _report(line: dict[str, Any], clip: MotionClip, *, as_json: bool) -> None:
    """Print the files of a motion, and say what is wrong with it."""
    _report_rewrite(clip)
    _report_quality(line, clip)
    if as_json:
        console.result_json(line)
        return
    for path in line["files"].values():
        console.result(console.home_relative(path))


def _report_rewrite(clip: MotionClip) -> None:
    about = clip.manifest
    if about["rewritten"] != about["prompt"]:
        drawn = ", ".join(each["name"] for each in about.get("bearing") or ())
        beside = f", with what is drawn on it: {drawn}" if drawn else ""
        console.say(f"{about['prompt']!r} was read as {about['rewritten']!r}{beside}.")
    elif "not_rewritten" in about:
        console.say(f"{about['prompt']!r} was read as it is: {about['not_rewritten']}.")


def _report_quality(line: dict[str, Any], clip: MotionClip) -> None:
    quality = line["quality"]
    if quality is None:
        return
    about = f"{line['prompt']!r}, seed {line['seed']}"
    if faults := [flag for flag in quality["flags"] if flag not in SAID_APART]:
        console.say(f"{about}: the motion has the flags {', '.join(faults)}.")
    if POSTURE_JUMP in quality["flags"]:
        from marey.quality.postures import posture_jumps

        for jump in posture_jumps(clip):
            way = "stand up" if jump["rise"] > 0 else "go down"
            console.say(
                f"{about}: at {jump['start']:g} s the person would have to {way} within "
                f"{jump['end'] - jump['start']:.1f} s. Give that a row of its own, or leave a gap of a second or two."
            )
    if OFF_PROMPT in quality["flags"]:
        rows: list[dict[str, Any]] = clip.manifest.get("timeline", {}).get("rows", [])
        missed = [row for row in rows if row["match"] is not None and row["match"] < SHOWN]
        for row in missed:
            times = f"{row['start']:g}-{row['end']:g}"
            console.say(f"{about}: {times} s does not show {row['prompt']!r} (match {row['match']:g}).")
        if not missed:
            console.say(f"{about}: the motion does not show the prompt (match {quality['match']['value']:g}).")
    if PART_LEFT_OUT in quality["flags"]:
        parts = ", ".join(map(repr, clip.manifest["unread"]))
        console.say(f"{about}: the motion leaves out {parts}, which the model does not know.")
    for error in quality.get("constraints") or ():
        if error["missed"]:
            turn = "" if error["mean_deg"] is None else f", {error['mean_deg']:.0f} degrees"
            far = f"{100 * error['mean_m']:.1f} cm on average, {100 * error['max_m']:.1f} cm at most{turn}"
            console.say(f"{about}: constraints.{error['index']} ({error['type']}) is missed by {far}.")


def _bundle_for(reader: rows.PromptReader, items: list[Item], bundle: str | None) -> tuple[Bundle, Settings]:
    """Return the bundle that makes the items, and the settings of this process.

    Raises:
        InvalidItems: with all problems of the rows, lengths and settings of the bundle among them.
        InvalidInput, NotFound, InvalidBundle: there is no such bundle, or the rows name several models.
    """
    try:
        from marey.bundles import choose_bundle
        from marey.core.settings import settings
    except ImportError as error:
        if reader.total:
            raise reader.error() from None
        raise needs_extra("worker", error) from error
    if not items:
        raise reader.error()
    config = settings()
    try:
        chosen = choose_bundle(bundle or _one_model(items, config.default_model), config=config)
        reader.add(_problems(reader, items, chosen))
    except MareyError:
        if reader.total:
            raise reader.error() from None
        raise
    if reader.total:
        raise reader.error()
    return chosen, config


def _problems(reader: rows.PromptReader, items: Iterable[Item], bundle: Bundle) -> list[Problem]:
    """Return the problems of lengths and settings that the bundle does not support, before it is loaded.

    Raises:
        InvalidBundle: not a bundle of a model that runs here.
    """
    from marey.bundles.limits import FIELD_CHECKS
    from marey.registry import find_model, model_names

    if find_model(bundle.manifest.model) is None:
        raise InvalidBundle(
            f"is a bundle of {bundle.manifest.model!r}, which does not run here",
            where=str(bundle.path),
            hint=f"Models that do: {', '.join(model_names())}.",
        )
    problems: list[Problem] = []
    for number, item in enumerate(items, 1):
        for field, check in FIELD_CHECKS.items():
            try:
                check(bundle, getattr(item, field))
            except InvalidBundle:
                raise
            except InvalidInput as error:
                problems.append(Problem(number, field, error.on_a_line))
    return reader.located(problems)


def _refuse(reader: rows.PromptReader, items: Iterable[Item], bundle: Bundle, studio: OneShot | None = None) -> None:
    """Refuse prompts that the bundle does not know; by words alone before it is loaded.

    Raises:
        OutOfScope: with every such prompt.
        InvalidInput: the bundle lists no actions.
    """
    from marey.bundles.scope import refuse_unknown
    from marey.vocabulary.scope import match_scope

    lines = (
        (line, row, prompt, bundle)
        for line, item in zip(reader.lines, items, strict=True)
        for row, prompt in prompts_with_rows(item.prompt, item.timeline)
    )
    match = match_scope if studio is None else studio.match_scope
    refuse_unknown(lines, where=reader.where, unit=reader.unit, match=match)


def _examine(reader: rows.PromptReader, items: list[Item], studio: OneShot, policy: ScopePolicy) -> None:
    """Refuse prompts that the bundle does not know, or warn of them, by words and meaning."""
    from marey.bundles.limits import stated_seconds_of
    from marey.vocabulary.report import ScopeReport

    manifest = studio.bundle.manifest
    if policy == "ignore":
        return
    if policy == "refuse":
        _refuse(reader, items, studio.bundle, studio)
    report, lengths = ScopeReport(), stated_seconds_of(studio.bundle)
    if manifest.actions is not None:
        prompts = {prompt for item in items for _, prompt in prompts_with_rows(item.prompt, item.timeline)}
        scopes = {prompt: studio.match_scope(prompt, manifest.actions) for prompt in prompts}
        report.decided = {(manifest.name, prompt): scope for prompt, scope in scopes.items()}
    for item in items:
        rows_of_item = () if item.timeline is None else prompts_with_rows(item.prompt, item.timeline)
        report.judge(item.prompt, manifest.name, manifest.actions, lengths=lengths, rows=rows_of_item)
    console.warn_all(report.warnings())


def _one_model(items: Iterable[Item], default: str) -> str:
    """The model all items are for; one process loads one.

    Raises:
        InvalidInput: they name several.
    """
    models = sorted({item.model or default for item in items})
    if len(models) > 1:
        raise InvalidInput(
            f"the prompts name {len(models)} models: {', '.join(models)}",
            hint="Generate them one model at a time, or submit them to a server.",
        )
    return models[0]


def _exporters(formats: list[str] | None, export: ExportOptions) -> list[Exporter[Any]]:
    """Return the exporters of the formats, each once; by default all installed ones that are stored.

    Raises:
        MissingExtra: an extra that writes a format is not installed.
        InvalidInput: there is none for a format, none of them has an option of the export, a format needs one that is
            not given, or an unknown rig.
        NotFound, InvalidFile, TooLarge: the rig cannot be read.
    """
    from marey.exporters import check_known, check_writers, exporters

    check_known(formats or ())
    known = exporters()
    stored = [name for name, exporter in known.items() if exporter.stored]
    kinds = [known[name] for name in dict.fromkeys(formats or stored)]
    check_writers(kinds, export)
    if export.rig is not None:
        from marey.motion.retarget import load_body

        load_body(export.rig, export.rig_map)  # it is kept; a wrong name is found before a bundle is loaded
    return kinds


def _plan(
    items: list[Item],
    bundle: Bundle,
    folder: Path,
    template: str,
    kinds: list[Exporter[Any]],
    constraints: Sequence[Mapping[str, Any]],
) -> list[Planned]:
    """Plan the motions and their files.

    Raises:
        InvalidInput: two motions would have one name, an item lacks a tag, or a name is not a plain file name.
    """
    from marey.bundles.limits import length_of, sampling_of
    from marey.cli.roles.generating import Wanted, constraints_of

    names = FileNames(template)

    def of(index: int, item: Item) -> Iterator[Planned]:
        seed = secrets.randbelow(MAX_SEED - item.variants + 2) if item.seed is None else item.seed
        settings, seconds = sampling_of(bundle, item), length_of(bundle, item)
        for variant in range(item.variants):
            asked = constraints_of(item, constraints)
            wanted = Wanted(item.prompt, seed + variant, seconds, settings, item.timeline, asked)
            name = item.name or slug(item.prompt)
            naming = Naming(
                index,
                name,
                seed + variant,
                variant,
                bundle.manifest.model,
                "local",
                item.tags,
                bundle.reference,
                slug(item.prompt),
            )
            paths = {kind.format: folder / names.of((index, variant), naming, kind.extension) for kind in kinds}
            yield Planned(item, variant, wanted, paths)

    return [plan for index, item in enumerate(items) for plan in of(index, item)]


def _write(
    plan: Planned, clip: MotionClip, elapsed: float, bundle: Bundle, export: ExportOptions, *, overwrite: bool
) -> dict[str, Any]:
    """Write the files of a motion, and return its output line.

    Raises:
        Conflict: one of the files exists with other content; none is written then.
    """
    from marey.exporters import Coordinates, exporters

    contents = {kind: exporters()[kind].write(clip, Coordinates.of(export)) for kind in plan.paths}
    _write_changed({path: contents[kind] for kind, path in plan.paths.items()}, overwrite=overwrite)
    return {
        "job": None,
        "item": None,
        "motion": hashlib.sha256(contents["npz"] if "npz" in contents else clip.to_npz()).hexdigest(),
        "name": plan.item.name,
        "prompt": plan.item.prompt,
        "variant": plan.variant,
        "model": bundle.manifest.model,
        "bundle": bundle.reference,
        "licence": clip.manifest.get("licence", bundle.manifest.licence),
        "seed": plan.wanted.seed,
        "state": "succeeded",
        "error": None,
        "frames": clip.frames,
        "fps": clip.fps,
        "elapsed": elapsed,
        "quality": clip.manifest.get("quality"),
        "selection": clip.manifest.get("selection"),
        "scope": clip.manifest.get("scope"),
        "files": {kind: str(path.absolute()) for kind, path in plan.paths.items()},
    }


def _write_changed(files: Mapping[Path, bytes], *, overwrite: bool) -> None:
    """Write the files that are missing or hold something else, once it is known that all may be written."""
    from marey.motion.files import write_atomically

    changed = [path for path, content in files.items() if not path.exists() or path.read_bytes() != content]
    for path in changed:
        if path.exists() and not overwrite:
            raise Conflict(
                "already exists and holds something else",
                where=str(path),
                hint="Choose another folder, or --overwrite.",
            )
    for path in changed:
        write_atomically(path, files[path])
