"""Training data from captures, for `marey data`."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.core.extras import extra

if TYPE_CHECKING:
    from marey.bundles import TextSpec
    from marey.data.pack import JointsPack
    from marey.data.paraphrase import Paraphrased
    from marey.motion.units import Unit


OWN, PACK = "own", "pack"
LABELLER = "srl-open"
"""Reads captions and, in the bundles trained on them, prompts: its terms allow production use."""


@dataclass(frozen=True)
class CaptureSources:
    """The sources of `marey data pack` and `prepare`.

    Attributes:
        named: source and its archive, folder or file: a known set, `own` (a folder that describes itself) or `pack`.
        processes: how many retarget at once.
        note: called with a sentence on the members of an archive that were passed over.
    """

    named: Sequence[tuple[str, Path]]
    processes: int
    note: Callable[[str], None]


def read_captures(sources: CaptureSources, progress: Callable[[str, int, int | None], None]) -> list[JointsPack]:
    """Read the clips of each source on the 22-joint skeleton, at 20 fps.

    Raises:
        InvalidInput: an unknown source.
        NotFound, InvalidFile, TooLarge: from reading.
    """
    with extra("worker"):
        from marey.data.dataset import known_sets
        from marey.data.feature_sets import FEATURE_SETS
        from marey.data.pack import JointsPack
        from marey.data.prepare import CaptureSet, pack_set
    known = known_sets()
    for name, _ in sources.named:
        if name in FEATURE_SETS:
            hint = f"Write: marey data prepare {name} FOLDER -o DIR"
            raise InvalidInput(f"{name} is published as features: it can only be prepared, and by itself", hint=hint)
        if name not in (*known, OWN, PACK):
            every = ", ".join((*known, *FEATURE_SETS, OWN, PACK))
            raise InvalidInput(f"there is no source {name!r}", hint=f"Known: {every}.")
    packs: list[JointsPack] = []
    for name, path in sources.named:
        if name == PACK:
            packs.append(JointsPack.load(path))
        else:
            captures = CaptureSet.own(path) if name == OWN else CaptureSet.known(name, path)
            report = partial(progress, captures.dataset.name)
            packs.append(pack_set(captures, processes=sources.processes, progress=report, note=sources.note))
    return packs


def pack_data(sources: CaptureSources, output: Path, progress: Callable[[str, int, int | None], None]) -> list[Path]:
    """Write a joints pack of each source into a folder: small enough to carry to the machine that trains.

    Raises:
        InvalidInput, NotFound, InvalidFile, TooLarge: see `read_captures`.
    """
    output.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    for pack in read_captures(sources, progress):
        paths.append(output / f"{pack.clips[0].dataset}.pack.npz")
        pack.save(paths[-1])
    return paths


def prepare_data(
    sources: CaptureSources, output: Path, speed: float, progress: Callable[[str, int, int | None], None]
) -> str:
    """Prepare training data, with clips slower and faster by the share `speed`, and return a line that describes it.

    A set that is published as features is prepared by itself, as it is.

    Raises:
        InvalidInput, NotFound, InvalidFile, TooLarge: see `read_captures`; or `speed` with published features.
        Conflict: the folder is in use.
    """
    with extra("worker"):
        from marey.data.feature_sets import FEATURE_SETS
    report = partial(progress, "building")
    if len(sources.named) == 1 and sources.named[0][0] in FEATURE_SETS:
        name, path = sources.named[0]
        if speed:
            raise InvalidInput(f"{name} is published as features, which keep their speed", where="--speed")
        manifest = FEATURE_SETS[name](path, output, progress=report)
    else:
        packs = read_captures(sources, progress)
        from marey.data.build import build

        manifest = build(packs, output, speed=speed, progress=report)
    return ", ".join(f"{split} {count} clips" for split, count in manifest.splits.items())


def mix_data(
    base: Path, other: Path, share: float, output: Path, seed: int, progress: Callable[[int, int], None]
) -> str:
    """Mix prepared data, and return a line that describes the mix.

    Raises:
        InvalidInput, NotFound, InvalidFile, Conflict: see `marey.training.mixing.mix_with_texts`.
    """
    with extra("worker"):
        from marey.training.mixing import mix_with_texts
    manifest = mix_with_texts(base, other, share, output, seed=seed, progress=progress)
    return ", ".join(f"{split} {count} clips" for split, count in manifest.splits.items())


@dataclass(frozen=True)
class ProposedFiles:
    """A proposed `dataset.toml`, and the paths of written files."""

    text: str
    written: tuple[Path, ...] = ()


def is_unprepared(folder: Path) -> bool:
    """Return True for a folder with BVH files that is not a prepared one."""
    with extra("worker"):
        from marey.data.manifest import MANIFEST
        from marey.data.propose import bvh_files
    return not (folder / MANIFEST).exists() and any(bvh_files(folder))


def propose_dataset(folder: Path, *, write: bool) -> ProposedFiles:
    """Propose the `dataset.toml` of a folder with BVH files, and an `index.csv` where there is none.

    Args:
        folder: with BVH files, at any depth.
        write: write the files.

    Raises:
        Conflict: there is a `dataset.toml` already.
        InvalidFile: no rig is recognised.
    """
    with extra("worker"):
        from marey.data.dataset import DATASET, INDEX
        from marey.data.propose import index_of, propose
        from marey.motion.files import write_atomically
    if write and (folder / DATASET).exists():
        raise Conflict("already exists", where=str(folder / DATASET), hint="Move it away, or leave out --write.")
    text = propose(folder).toml()
    files = {DATASET: text} | ({} if (folder / INDEX).exists() else {INDEX: index_of(folder)})
    if not write:
        return ProposedFiles(text)
    for name, content in files.items():
        write_atomically(folder / name, content.encode())
    return ProposedFiles(text, tuple(folder / name for name in files))


def inspect_data(folder: Path, clip: str | None) -> dict[str, Any]:
    """Summarise a prepared folder, or one clip of it, after a check of its hashes.

    Raises:
        NotFound, InvalidFile: no such folder or clip, or a changed file.
    """
    with extra("worker"):
        from marey.data.inspect import summarize
        from marey.data.prepared import PreparedData
    data = PreparedData.open(folder)
    if clip is None:
        return summarize(data).model_dump(mode="json")
    for found in data.clips:
        if found.id == clip:
            return found.model_dump(mode="json")
    raise NotFound(f"there is no clip {clip!r}", where=str(folder), hint=f"The first is {data.clips[0].id}.")


@dataclass(frozen=True)
class TextChoice:
    """How captions are read; see `marey.bundles.TextSpec`. None = the standard.

    Attributes:
        model: bundle whose specification is used; excludes all others.
        encoder, labeller: names.
        weights: folder of the encoder's weights.
        as_written: keep captions of several actions in their own order.
        reuse: prepared folder whose captions need not be read again.
    """

    model: str | None = None
    encoder: str | None = None
    labeller: str | None = None
    weights: Path | None = None
    as_written: bool = False
    reuse: Path | None = None


def encode_captions(folder: Path, choice: TextChoice, progress: Callable[[int, int], None]) -> int:
    """Write `texts.npz` of a prepared folder, and return the number of its captions.

    Raises:
        InvalidInput: options that exclude each other, an unknown encoder, or captions that another encoder has read.
        NotFound, InvalidBundle, InvalidFile: the data or the weights; see `TextPipeline.load`.
    """
    with extra("worker"):
        from marey.data.prepared import PreparedData
        from marey.text.pipeline import TextPipeline
        from marey.training.texts import CHUNK, CaptionTexts, KnownCaptions
    spec = _text_spec(choice)
    data = PreparedData.open(folder)
    captions = [clip.all_captions for clip in data.clips]
    pipeline = TextPipeline.load(spec, encoder_path=choice.weights)
    processes = min(os.cpu_count() or 1, -(-sum(map(len, captions)) // CHUNK))  # each loads the weights
    known = None if choice.reuse is None else KnownCaptions.load(PreparedData.open(choice.reuse))
    CaptionTexts.build(
        captions,
        pipeline,
        known=known,
        processes=processes,
        encoder_path=choice.weights,
        progress=progress,
    ).save(folder)
    return sum(map(len, captions))


def paraphrase_captions(folder: Path, times: int, progress: Callable[[int, int], None]) -> Paraphrased:
    """Rephrase the captions of a set by the language model of the settings, each `times` times.

    Raises:
        InvalidInput: no language model is named, or more times than there are manners, or nothing to rephrase.
        NotFound, InvalidFile: the folder is not a set.
        Unreachable: the language model gives no usable answers.
    """
    with extra("worker"):
        from marey.core.settings import settings
        from marey.data.paraphrase import paraphrase
        from marey.text.openai_rewriter import Endpoint, OpenAIRewriter
        from marey.text.wordings import PARAPHRASES
    if not 1 <= times <= len(PARAPHRASES):
        raise InvalidInput(f"is {times}; captions are rephrased 1 to {len(PARAPHRASES)} times", where="--times")
    endpoint = Endpoint.of(settings())
    return paraphrase(folder, [OpenAIRewriter(endpoint, question) for question in PARAPHRASES[:times]], progress)


def _text_spec(choice: TextChoice) -> TextSpec:
    from marey.bundles import TextSpec, choose_bundle
    from marey.text.encoders import WIDTHS

    if choice.model is not None:
        if choice.encoder or choice.labeller or choice.weights or choice.as_written:
            raise InvalidInput("names encoder and labeller already", where="--model", hint="Leave the others out.")
        spec = choose_bundle(choice.model).manifest.text
        if spec is None:
            raise InvalidInput(f"{choice.model!r} does not read prompts", where="--model")
        return spec.model_copy(update={"style": ()})  # that of other data
    encoder = choice.encoder or "minilm"
    if encoder not in WIDTHS:
        raise InvalidInput(f"unknown encoder {encoder!r}", where="--encoder", hint=f"Known: {', '.join(WIDTHS)}.")
    return TextSpec.model_validate(
        {
            "encoder": encoder,
            "width": WIDTHS[encoder],
            "labeller": choice.labeller or LABELLER,
            "in_order": not choice.as_written,
        }
    )


@dataclass(frozen=True)
class SegmentOptions:
    """How captures are cut; see `marey.data.segment.SegmentRule`, and `unit` of BVH files."""

    shortest: float
    longest: float
    share: float
    sigma: float
    seed: int
    unit: Unit


def segment_captures(
    files: Sequence[Path], output: Path, options: SegmentOptions, progress: Callable[[str, int, int | None], None]
) -> list[str]:
    """Cut captures into pieces, write their index and pictures, and return a line about each file.

    Raises:
        InvalidInput, Conflict, NotFound, InvalidFile, TooLarge: see `marey.data.segment_files.segment_files`.
    """
    with extra("worker"):
        from marey.data.segment import SegmentRule
        from marey.data.segment_files import segment_files
    rule = SegmentRule(options.shortest, options.longest, options.share, options.sigma, options.seed)
    done = segment_files(files, output, rule, unit=options.unit, progress=partial(progress, "segmenting"))
    lines: list[str] = []
    for file in done:
        seconds, pieces = len(file.found.speed) / file.found.fps, len(file.found.pieces)
        short = "" if pieces else f": shorter than {options.shortest:g} s, left out"
        lines.append(f"{file.path.name}: {seconds:.1f} s, {pieces} pieces{short}")
    return lines
