"""`marey data …`: training data from capture archives."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from marey.cli import console
from marey.cli.commands.convert import FromUnit
from marey.core.errors import InvalidInput

app = typer.Typer(help="Training data from capture archives.", no_args_is_help=True)

Prepared = Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `marey data prepare` wrote.")]


Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE PATH …",
        help="A known set (an unknown name lists them) with its archive or folder; own with a folder that has "
        "dataset.toml and index.csv; pack with a file of `pack`; humanml3d, kit, cmp or snapmogen with the published "
        "folder, alone.",
    ),
]
Processes = Annotated[int, typer.Option("--processes", min=1, help="Number of processes that retarget.")]


@app.command()
def pack(
    pairs: Sources,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for SOURCE.pack.npz.")],
    processes: Processes = 2,
) -> None:
    """Retarget archives only: small files to carry to the machine that prepares and trains."""
    from marey.cli.roles import data

    sources = data.CaptureSources(_named(pairs), processes, console.say)
    with _progress() as progress:
        paths = data.pack_data(sources, output, progress)
    for path in paths:
        console.result(str(path))


@app.command()
def prepare(
    pairs: Sources,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to; must be empty or new.")],
    processes: Processes = 2,
    speed: Annotated[
        float,
        typer.Option(
            "--speed",
            min=0.0,
            max=0.5,
            help="Add each training clip slower and faster by this share, such as 0.15.",
        ),
    ] = 0.0,
) -> None:
    """Retarget archives to the 22-joint skeleton, mirror, splice, caption, and write arrays with a manifest; or take
    over a set that is published as features."""
    from marey.cli.roles import data

    sources = data.CaptureSources(_named(pairs), processes, console.say)
    with _progress() as progress:
        manifest = data.prepare_data(sources, output, speed, progress)
    console.say(f"{output}: {manifest}")
    console.result(str(output))


@app.command()
def mix(
    base: Annotated[Path, typer.Argument(metavar="BASE", help="Prepared data that are kept whole.")],
    other: Annotated[Path, typer.Argument(metavar="OTHER", help="Prepared data of the same features, to add from.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to; must be empty or new.")],
    share: Annotated[
        float, typer.Option("--share", min=0.0, max=1.0, help="Share of the training clips of OTHER.")
    ] = 1.0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the draw.")] = 0,
) -> None:
    """Add a share of another set's training clips; clips for tests and statistics stay those of BASE, for its
    tokenizer."""
    from marey.cli.roles import data

    with _progress() as progress:
        line = data.mix_data(base, other, share, output, seed, lambda done, total: progress("mixing", done, total))
    console.say(f"{output}: {line}")
    console.result(str(output))


def _named(pairs: list[str]) -> list[tuple[str, Path]]:
    if len(pairs) % 2:
        raise InvalidInput("a SOURCE without its PATH", hint="Write: marey data prepare bandai-namco ARCHIVE -o DIR")
    return [(name, Path(path)) for name, path in zip(pairs[::2], pairs[1::2], strict=True)]


@contextmanager
def _progress() -> Generator[Callable[[str, int, int | None], None]]:
    with console.bar() as bar:
        task = bar.add_task("reading", total=None)
        yield lambda what, done, total: bar.update(task, description=what, completed=done, total=total or None)


@app.command()
def inspect(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A prepared folder, or one with BVH files.")],
    clip: Annotated[str | None, typer.Option("--clip", help="Show one clip with its captions.")] = None,
    write: Annotated[
        bool, typer.Option("--write", help="Write the proposed dataset.toml and index.csv into a folder of BVH files.")
    ] = False,
    as_json: console.Json = False,
) -> None:
    """Verify a prepared folder's hashes and summarise its content, or propose the dataset.toml of a folder with BVH
    files."""
    from marey.cli.roles import data

    unprepared = data.is_unprepared(folder)
    if unprepared and clip is not None:
        raise InvalidInput("shows a clip of prepared data, and this folder is not prepared", where="--clip")
    if write and not unprepared:
        raise InvalidInput("writes into a folder of BVH files, and this folder is prepared", where="--write")
    if unprepared:
        proposed = data.propose_dataset(folder, write=write)
        for path in proposed.written:
            console.say(f"{path} was written: fill in what is empty.")
        if as_json:
            console.result_json({"dataset": proposed.text})
        elif not write:
            console.result(proposed.text.rstrip())
        return
    found = data.inspect_data(folder, clip)
    if as_json:
        console.result_json(found)
        return
    for name, value in found.items():
        rows = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        if not rows:
            console.result(f"{name:<10} {value}")
        for key, entry in rows:
            console.result(f"{name:<10} {key}: {_inline(entry)}")


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {entry}" for key, entry in value.items())
    return " | ".join(map(str, value)) if isinstance(value, list) else str(value)


@app.command()
def text(
    folder: Prepared,
    model: Annotated[
        str | None, typer.Option("--model", help="Bundle whose text specification to use; none = the standard one.")
    ] = None,
    encoder: Annotated[
        str | None,
        typer.Option(
            "--encoder",
            help="minilm (the standard), clip-vit-b32, clip-vit-l14, t5-base, t5-v1_1-base or distilbert-base-uncased.",
        ),
    ] = None,
    labeller: Annotated[
        str | None,
        typer.Option("--labeller", help="srl-open (the standard), light, bert-srl, none, or a bundle's name or path."),
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option("--weights", help="Folder of the encoder's weights; none = where they are installed."),
    ] = None,
    as_written: Annotated[
        bool,
        typer.Option("--as-written", help="Keep the order of words; default: several actions in the order of time."),
    ] = False,
    reuse: Annotated[
        Path | None,
        typer.Option("--reuse", help="Prepared folder, read before: only captions that it has not are read."),
    ] = None,
) -> None:
    """Parse and encode the captions, once for all training runs."""
    from marey.cli.roles import data

    with console.bar() as bar:
        task = bar.add_task("captions", total=None)
        choice = data.TextChoice(model, encoder, labeller, weights, as_written, reuse)
        count = data.encode_captions(folder, choice, lambda done, total: bar.update(task, completed=done, total=total))
    console.say(f"{count} captions encoded")


@app.command()
def paraphrase(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder of captures with dataset.toml and index.csv.")
    ],
    times: Annotated[int, typer.Option("--times", help="Paraphrases of each caption, 1 to 4, in other manners.")] = 2,
) -> None:
    """Rephrase the captions of a set by a language model: captions-paraphrases.csv beside its index.

    Captions leave this machine: MAREY_REWRITER_URL, MAREY_REWRITER_MODEL and MAREY_REWRITER_KEY name the model. Called
    again, it goes on with clips that have none yet.
    """
    from marey.cli.roles import data

    with console.bar() as bar:
        task = bar.add_task("clips", total=None)
        found = data.paraphrase_captions(
            folder, times, lambda done, total: bar.update(task, completed=done, total=total)
        )
    for reason, count in sorted(found.refused.items(), key=lambda each: -each[1])[:10]:
        console.say(f"{count} not used: {reason}")
    console.say(f"{found.written} paraphrases written; clips that have some: {found.clips}")
    console.result(str(found.path))


@app.command()
def segment(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Long captures, such as .bvh or .npz.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write to; must be empty or new.")],
    shortest: Annotated[float, typer.Option("--shortest", help="Shortest piece in seconds.")] = 4.0,
    longest: Annotated[
        float, typer.Option("--longest", help="Longest piece in seconds; at least twice the shortest.")
    ] = 12.0,
    share: Annotated[
        float, typer.Option("--share", help="Probability of a cut at the stillest moment; 0 at the fastest trough.")
    ] = 0.5,
    sigma: Annotated[
        float, typer.Option("--sigma", help="Smoothing of the speed: standard deviation in seconds.")
    ] = 0.25,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the draws.")] = 0,
    from_unit: FromUnit = "cm",
) -> None:
    """Cut long captures at still moments: writes an index.csv of the pieces, and a picture of each capture's speed."""
    from marey.cli.roles import data

    options = data.SegmentOptions(shortest, longest, share, sigma, seed, from_unit)
    with _progress() as progress:
        lines = data.segment_captures(files, output, options, progress)
    for line in lines:
        console.say(line)
    console.result(str(output))
