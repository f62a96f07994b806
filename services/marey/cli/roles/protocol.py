"""The published protocol, measured in this process, for `marey eval run --protocol`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import get_model, resolve

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.data.prepared import PreparedData
    from marey.evaluator.protocol import Judge, Subject
    from marey.generation.port import Generator
    from marey.nn.motion_tokenizer import MotionTokenizer

REAL = "real"
"""Name in place of a bundle: real motions alone are measured."""


@dataclass(frozen=True)
class ProtocolRequest:
    """A measurement: the bundle, its evaluators and data, and where the results go.

    Attributes:
        bundle: a generator, or `REAL`.
        evaluators: bundles that measure.
        data: the prepared folder whose test captions are asked for.
        output: folder of the repeats and of `report.md` and `report.json`.
        settings: of sampling.
        repeats: generations of the split.
        seed: of the draws.
        device, threads: of torch.
    """

    bundle: str
    evaluators: Sequence[str]
    data: Path
    output: Path
    settings: Mapping[str, float]
    repeats: int
    seed: int
    device: str = "auto"
    threads: int = 0


@dataclass(frozen=True)
class ProtocolReport:
    """The report, as JSON values and as tables."""

    document: Mapping[str, Any]
    markdown: str


def run_protocol(request: ProtocolRequest, progress: Callable[[int, int, int], None]) -> ProtocolReport:
    """Measure, and write the report; called again into the same folder, only what is missing is done.

    Args:
        request: what is measured.
        progress: called with repeat, motions done and all of the repeat.

    Raises:
        NotFound, InvalidBundle, InvalidFile: of the bundles and the data.
        InvalidInput: they do not belong together, or the folder is of another run.
    """
    with extra("worker"):
        from marey.data.prepared import PreparedData
        from marey.evaluator import protocol
    if not request.evaluators:
        raise InvalidInput("the protocol needs an evaluator", where="--evaluator", hint="Import one: t2m-evaluator.")
    data = PreparedData.open(request.data)
    judges = [_judge(name, data, request.device) for name in request.evaluators]
    options = protocol.ProtocolOptions(repeats=request.repeats, seed=request.seed)
    found = protocol.run_protocol(data, _subject(request), judges, request.output, options, progress=progress)
    return _write(found, request.output)


def measure_rows(
    data: Path, evaluator: str, repeats: int, *, device: str = "auto"
) -> Callable[[Generator[Any], Any, Path], Mapping[str, float]]:
    """Return a function that measures rows of an ablation: FID, Top-1, MM-Dist and, where there is one, FID of the
    tokenizer alone, each the mean over repeats, with the whole report in the row's folder.

    Args:
        data: the prepared folder whose test captions are asked for.
        evaluator: a bundle.
        repeats: generations of the split.
        device: of the evaluator.

    Raises:
        NotFound, InvalidBundle, InvalidFile: of the evaluator and the data.
    """
    with extra("worker"):
        from marey.data.prepared import PreparedData
        from marey.evaluator import protocol
        from marey.training.adherence import pipeline_of
    prepared = PreparedData.open(data)
    judge = _judge(evaluator, prepared, device)
    # No MModality, which takes as many motions again as the split: the tables of ablations have none.
    options = protocol.ProtocolOptions(repeats=repeats, prompts=0)

    def measure(generator: Generator[Any], settings: Any, folder: Path) -> Mapping[str, float]:
        subject = protocol.Subject(generator, pipeline_of(generator), settings, _tokenizer(generator.bundle, device))
        found = protocol.run_protocol(prepared, subject, [judge], folder, options)
        _write(found, folder)
        rows = [repeat[judge.evaluator.name] for repeat in found["repeats"]]
        columns = {"FID": ("generated", "fid"), "Top-1": ("generated", "r1"), "MM-Dist": ("generated", "mm_dist")}
        if "reconstructed" in rows[0]:
            columns["FID, tokenizer alone"] = ("reconstructed", "fid")
        return {title: mean(row[kind][metric] for row in rows) for title, (kind, metric) in columns.items()}

    return measure


def _judge(name: str, data: PreparedData, device: str) -> Judge:
    from marey.bundles import find_bundle
    from marey.evaluator.loading import load_evaluator
    from marey.evaluator.protocol import Judge

    bundle = find_bundle(name)
    captions = data if any(clip.tags for clip in data.clips) else None
    return Judge(load_evaluator(bundle, device=device, captions=captions), bundle.manifest.model)


def _write(found: Mapping[str, Any], output: Path) -> ProtocolReport:
    from marey.evaluator.protocol.report import document_of, markdown_of
    from marey.motion.files import write_atomically

    report = ProtocolReport(document_of(found), markdown_of(found))
    write_atomically(output / "report.json", json.dumps(report.document, indent=1).encode())
    write_atomically(output / "report.md", report.markdown.encode())
    return report


def _tokenizer(bundle: Bundle, device: str) -> MotionTokenizer | None:
    from marey.cli.roles.tokenizers import tokenizer_of
    from marey.nn.devices import choose_device

    found = tokenizer_of(bundle)
    return None if found is None else found.to(choose_device(device))


def _subject(request: ProtocolRequest) -> Subject | None:
    if request.bundle == REAL:
        return None
    from marey.bundles import choose_bundle
    from marey.bundles.limits import check_settings
    from marey.evaluator.protocol import Subject
    from marey.training.adherence import pipeline_of

    found = choose_bundle(request.bundle)
    spec = get_model(found.manifest.model, where=request.bundle)
    generator = resolve(spec.load)(found, device=request.device, threads=request.threads)
    settings = generator.settings(check_settings(found, request.settings))
    return Subject(generator, pipeline_of(generator, served=True), settings, _tokenizer(found, request.device))
