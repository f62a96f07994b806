"""The published protocol, measured in this process, for `marey eval run --protocol`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import get_model, resolve

if TYPE_CHECKING:
    from marey.evaluator.protocol import Subject

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
        from marey.bundles import find_bundle
        from marey.data.prepared import PreparedData
        from marey.evaluator import protocol
        from marey.evaluator.loading import load_evaluator
        from marey.evaluator.protocol.report import document_of, markdown_of
        from marey.motion.files import write_atomically
    if not request.evaluators:
        raise InvalidInput("the protocol needs an evaluator", where="--evaluator", hint="Import one: t2m-evaluator.")
    data = PreparedData.open(request.data)
    judges: list[protocol.Judge] = []
    for name in request.evaluators:
        bundle = find_bundle(name)
        captions = data if any(clip.tags for clip in data.clips) else None
        judges.append(
            protocol.Judge(load_evaluator(bundle, device=request.device, captions=captions), bundle.manifest.model)
        )
    options = protocol.ProtocolOptions(repeats=request.repeats, seed=request.seed)
    found = protocol.run_protocol(data, _subject(request), judges, request.output, options, progress=progress)
    report = ProtocolReport(document_of(found), markdown_of(found))
    write_atomically(request.output / "report.json", json.dumps(report.document, indent=1).encode())
    write_atomically(request.output / "report.md", report.markdown.encode())
    return report


def _subject(request: ProtocolRequest) -> Subject | None:
    if request.bundle == REAL:
        return None
    from marey.bundles import choose_bundle
    from marey.bundles.limits import check_settings
    from marey.cli.roles.tokenizers import tokenizer_of
    from marey.evaluator.protocol import Subject
    from marey.nn.devices import choose_device
    from marey.training.adherence import pipeline_of

    found = choose_bundle(request.bundle)
    spec = get_model(found.manifest.model, where=request.bundle)
    generator = resolve(spec.load)(found, device=request.device, threads=request.threads)
    tokenizer = tokenizer_of(found)
    if tokenizer is not None:
        tokenizer.to(choose_device(request.device))
    return Subject(generator, pipeline_of(generator), check_settings(found, request.settings), tokenizer)
