"""Run the protocol: repeat by repeat, each stored as it is done, so that a run that was interrupted goes on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.documents import read_json
from marey.core.errors import InvalidBundle, InvalidFile, InvalidInput, NotFound
from marey.data.prepared import PreparedData
from marey.evaluator.port import Evaluator
from marey.evaluator.protocol.metrics import METRICS, measure, measure_variety
from marey.evaluator.protocol.samples import Sample, draw_samples
from marey.evaluator.reconstruction import BATCH, rebuilt
from marey.generation.port import Generator, Request
from marey.items.values import MAX_SEED
from marey.motion.files import write_atomically
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.text.features import TextFeatures
from marey.text.pipeline import TextPipeline

REAL, RECONSTRUCTED, GENERATED = "real", "reconstructed", "generated"
Rows = dict[str, dict[str, dict[str, float]]]
"""Metrics by evaluator and row of one repeat."""
Motions = list[NDArray[np.float32]]


@dataclass(frozen=True)
class ProtocolOptions:
    """Sizes of the protocol; the defaults are the published ones.

    Attributes:
        repeats: generations of the whole split.
        pool: candidates of a retrieval.
        many, prompts, pairs: motions of a caption, captions, and pairs of motions of the MModality.
        split: of the data.
        seed: of the draws.
    """

    repeats: int = 20
    pool: int = 32
    many: int = 30
    prompts: int = 96
    pairs: int = 10
    split: str = "test"
    seed: int = 0


@dataclass(frozen=True)
class Judge:
    """An evaluator, with its kind: `t2m`, `tmr` …"""

    evaluator: Evaluator
    kind: str


@dataclass
class Subject:
    """A generator with what reads its prompts, its settings as it takes them, and its tokenizer, in evaluation mode;
    None = it has none."""

    generator: Generator[Any]
    pipeline: TextPipeline
    settings: Any
    tokenizer: MotionTokenizer | None = None
    _read: dict[str, TextFeatures] = field(default_factory=dict[str, TextFeatures])

    @property
    def rewriter(self) -> dict[str, str | None]:
        """Return name and language model of what rewrites captions before they are read; nothing if none does."""
        spec = self.pipeline.spec
        return {} if spec.rewriter == "none" else {"name": spec.rewriter, "model": spec.rewriter_model}

    def rewritten(self, captions: Sequence[str]) -> dict[str, int]:
        """Count captions, and those that were rewritten; the others were read as written.

        Raises:
            InvalidInput: none was: the row would not be of the rewriter.
        """
        self._parse(captions)
        read = [self._read[caption] for caption in dict.fromkeys(captions)]
        kept = [each.not_rewritten for each in read if each.not_rewritten is not None]
        if len(kept) == len(read):
            name = self.rewriter["name"]
            raise InvalidInput(f"the rewriter {name!r} rewrote no caption: {kept[0]}", where="MAREY_REWRITER")
        return {"captions": len(read), "rewritten": len(read) - len(kept)}

    def generate(self, asked: Sequence[tuple[str, int, int]]) -> Iterator[NDArray[np.float32]]:
        """Yield the features (T, D) of each (caption, frames, seed)."""
        self._parse([caption for caption, *_ in asked])
        rest = iter(asked)
        while part := list(islice(rest, self.generator.batch)):
            requests = [Request(self._read[caption], seed, frames) for caption, frames, seed in part]
            for made in self.generator.generate(requests, self.settings):
                assert made is not None  # no rows are dropped here
                yield made.features

    def reconstruct(self, motions: Sequence[NDArray[np.float32]]) -> Motions:
        """Return motions (T, D) through the tokenizer alone, T cut to whole tokens; none without one."""
        if self.tokenizer is None:
            return []
        rate = self.tokenizer.frames_per_token
        whole = [motion[: len(motion) - len(motion) % rate] for motion in motions]
        parts = (whole[low : low + BATCH] for low in range(0, len(whole), BATCH))
        return [made for part in parts for made in rebuilt(self.tokenizer, part)]

    def _parse(self, captions: Sequence[str]) -> None:
        new = [caption for caption in dict.fromkeys(captions) if caption not in self._read]
        self._read.update(zip(new, self.pipeline.features(new), strict=True))


Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class _Run:
    data: PreparedData
    subject: Subject | None
    judges: Sequence[Judge]
    options: ProtocolOptions
    folder: Path

    @property
    def about(self) -> dict[str, Any]:
        """Everything that the numbers depend on."""
        subject = self.subject
        generator = None if subject is None else subject.generator
        return {
            "protocol": "humanml3d",
            "data": {
                "names": [source.name for source in self.data.manifest.sources],
                "sha256": self.data.manifest.files["features.npy"].sha256,
                "layout": self.data.manifest.layout,
            },
            "generator": None if generator is None else generator.bundle.reference,
            "settings": {} if subject is None or generator is None else generator.describe_settings(subject.settings),
            **({"rewriter": subject.rewriter} if subject is not None and subject.rewriter else {}),
            "evaluators": [judge.evaluator.name for judge in self.judges],
            "rows": self._rows,
            "options": {name: value for name, value in asdict(self.options).items() if name != "repeats"},
        }

    @property
    def _rows(self) -> list[str]:
        subject = self.subject
        if subject is None:
            return [REAL]
        return [REAL, GENERATED] if subject.tokenizer is None else [REAL, RECONSTRUCTED, GENERATED]

    @property
    def key(self) -> str:
        return hashlib.sha256(json.dumps(self.about, sort_keys=True).encode()).hexdigest()

    def repeat(self, number: int, progress: Progress) -> dict[str, Any]:
        """Return a repeat, with its `rows`: read if it was done before, else measured and written."""
        file = self.folder / f"repeat-{number:02}.json"
        try:
            stored: Any = read_json(file)
        except NotFound:
            measured = {"key": self.key, **self._measure(number, progress)}
            write_atomically(file, json.dumps(measured, indent=1).encode())
            return measured
        if not isinstance(stored, dict) or "rows" not in stored:
            raise InvalidFile("is not a repeat of the protocol", where=str(file), hint="Remove it.")
        if stored.get("key") != self.key:
            hint = "Name another folder, or remove this one."
            raise InvalidInput("is of another generator, evaluator, data or options", where=str(file), hint=hint)
        return stored

    def _measure(self, number: int, progress: Progress) -> dict[str, Any]:
        options = self.options
        drawing, pooling = (
            np.random.default_rng(child) for child in np.random.SeedSequence([options.seed, number]).spawn(2)
        )
        samples = draw_samples(self.data, options.split, options.pool, drawing)
        motions = [sample.motion for sample in samples]
        subject, read = self.subject, {}
        if subject is not None and subject.rewriter:
            read = {"read": subject.rewritten([sample.caption for sample in samples])}
        made, many = self._generate(samples, drawing, progress)
        through = [] if subject is None else subject.reconstruct(motions)
        rows: Rows = {}
        for judge in self.judges:
            evaluator, state = judge.evaluator, pooling.bit_generator.state
            text = evaluator.embed_text([sample.caption for sample in samples])
            real = evaluator.embed_motion(motions)
            common = {"pool": options.pool, "distance": evaluator.distance}
            found = {REAL: measure(text, real, None, **common, rng=pooling)}
            for name, others in ((RECONSTRUCTED, through), (GENERATED, made)):
                if others:
                    pooling.bit_generator.state = state  # the same pools
                    found[name] = measure(text, evaluator.embed_motion(others), real, **common, rng=pooling)
            if many:
                variety = measure_variety(evaluator.embed_motion(many), options.many, options.pairs, pooling)
                found[GENERATED]["mmodality"] = variety
            rows[evaluator.name] = found
        return {"rows": rows, **read}

    def _generate(
        self, samples: Sequence[Sample], rng: np.random.Generator, progress: Progress
    ) -> tuple[Motions, Motions]:
        """Return a motion of each sample, and many of each of the first ones, caption by caption."""
        if self.subject is None:
            return [], []
        options = self.options
        asked = [(each.caption, len(each.motion)) for each in samples]
        asked += [pair for pair in asked[: options.prompts] for _ in range(options.many)]
        seeds = rng.integers(MAX_SEED, size=len(asked)).tolist()
        found: Motions = []
        for motion in self.subject.generate([(*pair, seed) for pair, seed in zip(asked, seeds, strict=True)]):
            found.append(motion)
            progress(len(found), len(asked))
        return found[: len(samples)], found[len(samples) :]


def run_protocol(
    data: PreparedData,
    subject: Subject | None,
    judges: Sequence[Judge],
    folder: Path,
    options: ProtocolOptions,
    *,
    progress: Callable[[int, int, int], None] = lambda repeat, done, total: None,
) -> dict[str, Any]:
    """Measure a generator, and the real motions, on the test captions of prepared data.

    Args:
        data: the prepared folder.
        subject: the generator; None = real motions alone.
        judges: the evaluators.
        folder: for `repeat-NN.json`; those that are there already are kept.
        options: sizes.
        progress: called with repeat, motions done and all of the repeat.

    Returns:
        what was run, and the rows of every repeat, as JSON values.

    Raises:
        InvalidInput: fewer than two repeats, layouts that differ, too few clips, or a folder of another run.
        InvalidFile: a stored repeat is damaged.
    """
    if options.repeats < 2:
        raise InvalidInput("one repeat has no interval", where="--repeats")
    run = _Run(data, subject, judges, options, folder)
    _check_layouts(run)
    folder.mkdir(parents=True, exist_ok=True)
    repeats = [
        run.repeat(number, lambda done, total, number=number: progress(number, done, total))
        for number in range(options.repeats)
    ]
    kinds = {judge.evaluator.name: judge.kind for judge in judges}
    found = run.about | {"kinds": kinds, "repeats": [each["rows"] for each in repeats], "metrics": list(METRICS)}
    return found | ({"read": [each["read"] for each in repeats]} if "rewriter" in found else {})


def _check_layouts(run: _Run) -> None:
    wanted = run.data.manifest.layout
    for judge in run.judges:
        if judge.evaluator.layout != wanted:
            raise InvalidInput(
                f"reads {judge.evaluator.layout}, and the data hold {wanted}", where=judge.evaluator.name
            )
    if run.subject is not None:
        manifest = run.subject.generator.bundle.manifest
        if manifest.layout != wanted:
            raise InvalidBundle(f"generates {manifest.layout}, and the data hold {wanted}", where=manifest.name)
