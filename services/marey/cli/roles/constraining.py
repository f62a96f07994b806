"""Measurement of constrained motions in this process: `marey eval constraints`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from marey.cli.roles.actions import MeasureOptions, RefereeReport
from marey.core.extras import extra

if TYPE_CHECKING:
    from marey.evaluator.constraints.cases import Case
    from marey.evaluator.constraints.measuring import ConstraintReading


def measure_constraints(bundle: str, data: Path | None, captured: int, options: MeasureOptions) -> RefereeReport:
    """Generate cases with and without their constraints, and measure errors and what the constraints cost.

    Args:
        data: a prepared folder, whose held-out clips give paths, poses and hands; None = drawn shapes alone.
        captured: number of such clips.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        NotFound, InvalidFile: of the prepared folder.
        InvalidInput: no such setting.
    """
    with extra("worker"):
        from marey.bundles import choose_bundle
        from marey.bundles.limits import check_settings
        from marey.core.settings import settings
        from marey.evaluator.constraints.measuring import constraints_document, constraints_markdown, read_case
        from marey.generate.oneshot import OneShot, Wanted
        from marey.training.adherence import write_report
    found = choose_bundle(bundle)
    values = check_settings(found, options.settings)
    config = settings().model_copy(update={"threads": options.threads} if options.threads else {})
    studio, cases = OneShot(found, config), _cases(data, captured, options.seeds)
    plain = [Wanted(case.prompt, case.seed, case.seconds, values) for case in cases]
    bound = [Wanted(case.prompt, case.seed, case.seconds, values, constraints=case.constraints) for case in cases]
    free = [clip for _, clip, _ in studio.make(plain)]
    readings: list[ConstraintReading] = []
    for case, clip, (_, made, _) in zip(cases, free, studio.make(bound), strict=True):
        readings.append(read_case(case, made, clip))
        options.progress(len(readings), len(cases))
    document = constraints_document(found.reference, dict(values), readings)
    table = constraints_markdown(found.reference, readings)
    if options.output is not None:
        write_report(document, table, options.output)
    return RefereeReport(table, document)


def _cases(data: Path | None, captured: int, seeds: int) -> Sequence[Case]:
    from marey.data.prepared import PreparedData
    from marey.evaluator.constraints.cases import captured_cases, shape_cases

    clips = [] if data is None else [*captured_cases(PreparedData.open(data, verify=False), captured)]
    return [*clips, *shape_cases(seeds)]
