"""`marey eval …`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from marey.cli import bulk, console, evaluating, options
from marey.cli.commands import schedules
from marey.cli.evaluating import EvaluationArguments
from marey.cli.references import FORMS, find, of_view
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    from marey.cli.roles.actions import MeasureOptions, RefereeReport
    from marey.client import Client, Evaluation

app = typer.Typer(help="Measure models: runs, their reports, schedules.", no_args_is_help=True)
app.add_typer(schedules.app, name="schedule")

Run = Annotated[str, typer.Argument(metavar="RUN", help=f"The evaluation: {FORMS}.")]
Runs = Annotated[list[str], typer.Argument(metavar="RUN…", help=f"Evaluations: of each {FORMS}.")]

Seeds = Annotated[int, typer.Option("--seeds", min=1, help="Motions of each prompt.")]
Threads = Annotated[int, typer.Option("--threads", min=0, help="Of torch; 0 = its own choice.")]
ReportFolder = Annotated[Path | None, typer.Option("-o", "--output", help="Folder for report.json and report.md.")]
JudgedBundle = Annotated[str, typer.Argument(metavar="BUNDLE", help="Model or bundle, or its folder.")]
State = Annotated[
    Literal["planned", "generating", "scoring", "done", "failed", "cancelled"] | None,
    typer.Option("--state", help="Only runs in this state."),
]


@app.command()
def run(
    bundle: evaluating.Bundle,
    split: evaluating.Split = evaluating.TEST,
    extra_columns: evaluating.Extra = "refuse",
    evaluator: evaluating.Evaluators = None,
    settings: evaluating.Settings = None,
    repeats: evaluating.Repeats = None,
    regenerate: evaluating.Regenerate = False,
    seed: evaluating.Seed = None,
    baseline: evaluating.Baseline = None,
    name: Annotated[str | None, typer.Option("--name", help="A name for the run.")] = None,
    comment: Annotated[str | None, typer.Option("--comment", help="A comment.")] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Show progress until it ends; exit 6 if it failed.")] = False,
    fail_on_regression: evaluating.FailOnRegression = False,
    timeout: evaluating.Timeout = None,
    protocol: Annotated[
        Literal["humanml3d"] | None,  # KIT-ML's as well
        typer.Option(
            "--protocol",
            help="Measure in this process by a published protocol, without a server: the test captions of --data, "
            "generated anew in every repeat. --bundle real measures captured motion alone.",
        ),
    ] = None,
    data: Annotated[
        Path | None, typer.Option("--data", metavar="DATA", help="A prepared folder, for --protocol.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder of the protocol's report; called again, it goes on there."),
    ] = None,
    device: Annotated[str, typer.Option("--device", help="auto, cpu, cuda, cuda:1 …, for --protocol.")] = "auto",
    as_json: console.Json = False,
) -> None:
    """Measure a model in the background; prints the run's id.

    A file of prompts has the columns prompt or timeline, seconds, expected, as in "walk straight then wave left", and
    in JSONL constraints.
    """
    if protocol is not None:
        others = {
            "--split": split != evaluating.TEST, "--baseline": baseline, "--name": name, "--comment": comment,
            "--wait": wait, "--fail-on-regression": fail_on_regression, "--timeout": timeout is not None,
            "--regenerate": regenerate,
        }  # fmt: skip
        evaluating.refuse_given(others, "asks the server, and --protocol measures in this process")
        _run_protocol(bundle, evaluator, data, output, settings, repeats, seed, device, as_json=as_json)
        return
    evaluating.refuse_given({"--data": data, "--output": output}, "is for --protocol")
    repeats = evaluating.repeats_of(repeats, regenerate=regenerate)
    single = evaluating.single_of(evaluator)
    asked = EvaluationArguments(bundle, single, split, settings, repeats, seed, baseline, extra_columns)
    wanted = asked.options()
    from marey.client import Client

    waits = wait or fail_on_regression
    with Client() as client:
        wanted["baseline"] = asked.baseline_of(client)
        made = client.evaluations.run(bundle, name=name, comment=comment, **wanted)
        if not as_json:
            console.result(made.id)
        elif not waits:
            console.result_json(made.raw)
        if waits:
            _follow(client, made.id, timeout, fail_on_regression=fail_on_regression, as_json=as_json)


def _run_protocol(
    bundle: str,
    evaluators: list[str] | None,
    data: Path | None,
    output: Path | None,
    settings: list[str] | None,
    repeats: int | None,
    seed: int | None,
    device: str,
    *,
    as_json: bool,
) -> None:
    from marey.cli.roles.protocol import ProtocolRequest, run_protocol

    if data is None or output is None:
        raise InvalidInput("needs --data and --output", where="--protocol")
    request = ProtocolRequest(
        bundle, evaluators or (), data, output, options.settings_of(settings or ()),
        evaluating.ANEW if repeats is None else repeats, seed or 0, device,
    )  # fmt: skip
    with console.bar() as bar:
        task = bar.add_task("repeat 1", total=None)
        report = run_protocol(
            request,
            lambda repeat, done, total: bar.update(
                task, description=f"repeat {repeat + 1}", completed=done, total=total
            ),
        )
    if as_json:
        console.result_json(report.document)
    else:
        console.result(report.markdown.rstrip("\n"))


@app.command("wait")
def wait_for(
    run: Run,
    fail_on_regression: evaluating.FailOnRegression = False,
    timeout: evaluating.Timeout = None,
    as_json: console.Json = False,
) -> None:
    """Wait until a run ends; exit 6 if it failed or was cancelled."""
    from marey.client import Client

    with Client() as client:
        _follow(
            client, find(client, "evaluation", run).id, timeout, fail_on_regression=fail_on_regression, as_json=as_json
        )


@app.command("list")
def list_runs(
    state: State = None,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List runs, newest first, with state and regressions."""
    from marey.client import Client

    with Client() as client:
        found = client.evaluations.list(state=state, page_size=console.page_size(limit))
        evaluating.show_runs(found, limit, as_json, full_ids=full_ids)


@app.command()
def show(run: Run, as_json: console.Json = False) -> None:
    """Show a run: its data, state, reason and numbers."""
    from marey.client import Client

    with Client() as client:
        found = client.evaluations.get(find(client, "evaluation", run).id).raw
    if as_json:
        console.result_json(found)
        return
    for field in ("id", "name", "comment", "schedule", "due", "state", "reason"):
        _line(field, found[field])
    _line("waits for", found["waits_for"])
    for field in ("bundle", "evaluator", "source", "repeats", "seed", "baseline"):
        _line(field, found["request"][field])
    _line("prompts", found["prompts"])
    for field in ("generation", "scoring"):
        job = found[field]
        _line(field, job and f"{job['ended']} of {job['total']} done, {job['succeeded']} succeeded (job {job['id']})")
    _line("regressed", None if found["regressed"] is None else "yes" if found["regressed"] else "no")
    for metric, value in (found["summary"] or {}).items():
        _line("metric", f"{metric} = {'not measured' if value is None else f'{value:g}'}")
    for event in found["events"]:
        _line(event["state"], f"{event['at']}: {event['reason']}")


@app.command()
def report(
    run: Run,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="A .html, .json or .md; none given = the text is written to stdout."),
    ] = None,
    overwrite: options.Overwrite = False,
) -> None:
    """Fetch the report of a finished run."""
    from marey.client import Client
    from marey.client.evaluations import report_format

    if output is not None:
        report_format(output)  # before the server is asked
    with Client() as client:
        run = find(client, "evaluation", run).id
        if output is None:
            console.result(client.evaluations.report(run).rstrip("\n"))
        else:
            path = client.evaluations.fetch_report(run, output, overwrite=overwrite)
            console.result(console.home_relative(path))


@app.command()
def compare(
    before: Annotated[str, typer.Argument(metavar="A", help=f"The earlier run: {FORMS}.")],
    after: Annotated[str, typer.Argument(metavar="B", help=f"The later run: {FORMS}.")],
    fail_on_regression: Annotated[
        bool, typer.Option("--fail-on-regression", help="Exit 8 when B is worse than A.")
    ] = False,
    as_json: console.Json = False,
) -> None:
    """Compare two runs of the same prompts and evaluator, motion by motion, by paired bootstrap."""
    from marey.client import Client

    with Client() as client:
        earlier, later = (find(client, "evaluation", each).id for each in (before, after))
        found = client.evaluations.compare(earlier, later)
    if as_json:
        console.result_json(found.raw)
    else:
        console.table(evaluating.COMPARISON, evaluating.comparison_rows(found))
    evaluating.check_comparison(found, fail_on_regression=fail_on_regression)


@app.command()
def cancel(runs: Runs, as_json: console.Json = False) -> None:
    """Cancel runs and their jobs; finished motions stay."""
    bulk.change_all("evaluation", runs, lambda client, each: client.evaluations.cancel(each), _ended, as_json=as_json)


def _ended(run: Evaluation) -> str:
    return f"cancelled {of_view('evaluation', run.raw)}: {run.state}"


def _line(field: str, value: object) -> None:
    if value is not None:
        console.result(f"{field:<11} {value}")


def _follow(client: Client, run: str, timeout: float | None, *, fail_on_regression: bool, as_json: bool) -> None:
    found = evaluating.watch_evaluation(client, run, timeout=timeout)
    if as_json:
        console.result_json(found.raw)
    elif found.state == "done":
        console.say(f"done: {found.reason}")
    evaluating.check_evaluation(found, fail_on_regression=fail_on_regression)


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Motion files, such as .bvh or .npz.")],
    expect: Annotated[
        str | None, typer.Option("--expect", help='Actions of the vocabulary, in order: "jump; then sit".')
    ] = None,
    as_json: console.Json = False,
) -> None:
    """Measure the quality of motion files, and whether they show actions. Needs no server; exit 6 on a fault."""
    from marey.cli.roles.checking import check_file

    faults = 0
    for path in files:
        found = check_file(path, expect)
        quality = found["quality"]
        faults += not quality["ok"] or found["shows"] is False
        if as_json:
            console.result_json(found)
            continue
        console.result(f"{console.home_relative(path)}: {', '.join(quality['flags']) or 'ok'}")
        for name in ("float_s", "skate", "penetration_mm", "pops", "range_deg", "self_contact"):
            _line(name, quality[name])
        if (value := quality["match"]["value"]) is not None:
            _line("match", value)
        if found["shows"] is not None:
            _line("shows", f"{'; '.join(found['expect'])}: {'yes' if found['shows'] else 'no'}")
    if faults:
        raise typer.Exit(6)


@app.command()
def adherence(
    bundle: JudgedBundle,
    seeds: Seeds = 3,
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="Length of every motion; none given = the model decides.")
    ] = None,
    settings: evaluating.Settings = None,
    prompts: Annotated[
        str,
        typer.Option(
            "--prompts",
            help="A set of test prompts that Marey has: evaluation, development, blind or fresh; no file.",
        ),
    ] = "evaluation",
    captions: Annotated[
        Path | None,
        typer.Option(
            "--captions",
            metavar="DATA",
            help="A prepared folder: its validation captions in place of the test prompts.",
        ),
    ] = None,
    every: Annotated[int, typer.Option("--every", min=1, help="Only each K-th prompt, for a quick look.")] = 1,
    steers: Annotated[int, typer.Option("--steers", min=0, help="Live sessions that are steered.")] = 0,
    walks: Annotated[int, typer.Option("--walks", min=0, help="Live sessions of 2,000 frames.")] = 0,
    threads: Threads = 0,
    output: ReportFolder = None,
    as_json: console.Json = False,
) -> None:
    """Check whether the motions of a bundle do what their prompts say, on test prompts that Marey has.

    Needs no server and no evaluator. Prompts of your own are measured by `marey eval run --split FILE`.
    """
    from marey.cli.roles.adherence import judge_adherence

    with console.bar() as bar:
        task = bar.add_task("judging", total=None)
        judged = judge_adherence(
            bundle, seeds=seeds, seconds=seconds, settings=options.settings_of(settings or ()), captions=captions,
            prompts=prompts, every=every, steers=steers, walks=walks, threads=threads, output=output,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    for group, reasons in judged.failures.items():
        console.say("\n  ".join([f"{group}:", *reasons[:6]]))
    if as_json:
        console.result_json(judged.document)
    else:
        console.result(judged.markdown.rstrip("\n"))


@app.command()
def actions(
    bundle: JudgedBundle,
    chosen: Annotated[
        list[str] | None, typer.Option("--action", help="An action of the vocabulary; may be repeated. Default: all.")
    ] = None,
    seeds: Seeds = 4,
    settings: evaluating.Settings = None,
    development: Annotated[
        bool, typer.Option("--development", help="By the prompts by which settings are chosen, not the held-out ones.")
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(
            "--record", metavar="DATA", help="Write the result into the bundle; DATA is the folder it was trained on."
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="PNG", help="Draw the first motion of each action.")
    ] = None,
    threads: Threads = 0,
    output: ReportFolder = None,
    as_json: console.Json = False,
) -> None:
    """Measure which actions of the vocabulary a bundle supports, by held-out prompts. Needs no server."""
    from marey.cli.roles.actions import measure_actions

    _measure(
        lambda how: measure_actions(bundle, chosen or (), how, development=development, record=record, picture=picture),
        seeds,
        settings,
        threads,
        output,
        as_json,
    )


@app.command()
def sequences(
    bundle: JudgedBundle,
    seeds: Seeds = 4,
    settings: evaluating.Settings = None,
    development: Annotated[
        bool, typer.Option("--development", help="By the prompts by which settings are chosen, not the held-out ones.")
    ] = False,
    threads: Threads = 0,
    output: ReportFolder = None,
    as_json: console.Json = False,
) -> None:
    """Measure whether a bundle shows two to four actions in the order that a prompt tells. Needs no server."""
    from marey.cli.roles.actions import measure_sequences

    _measure(
        lambda how: measure_sequences(bundle, how, development=development), seeds, settings, threads, output, as_json
    )


@app.command()
def pairs(
    bundle: JudgedBundle,
    chosen: Annotated[
        list[str] | None,
        typer.Option(
            "--property", help="side, count, order, direction, speed or duration; may be repeated. Default: all."
        ),
    ] = None,
    seeds: Seeds = 4,
    settings: evaluating.Settings = None,
    development: Annotated[
        bool, typer.Option("--development", help="By the prompts by which settings are chosen, not the held-out ones.")
    ] = False,
    threads: Threads = 0,
    output: ReportFolder = None,
    as_json: console.Json = False,
) -> None:
    """Measure whether a bundle tells left from right, two from three, slow from fast. Needs no server."""
    from marey.cli.roles.actions import measure_pairs

    _measure(
        lambda how: measure_pairs(bundle, chosen or (), how, development=development),
        seeds,
        settings,
        threads,
        output,
        as_json,
    )


@app.command()
def studio(
    bundle: JudgedBundle,
    seeds: Seeds = 1,
    settings: evaluating.Settings = None,
    threads: Threads = 0,
    output: ReportFolder = None,
    as_json: console.Json = False,
) -> None:
    """Measure a bundle on a list of 300 prompts that Marey has, written as a games studio would send it.

    Counts motions that show their prompt, and those that are flagged. The list is no file of yours, and shares no
    prompt with the sets of `marey eval adherence`. Needs no server.
    """
    from marey.cli.roles.actions import measure_studio

    _measure(lambda how: measure_studio(bundle, how), seeds, settings, threads, output, as_json)


@app.command()
def constraints(
    bundle: JudgedBundle,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DATA", help="A prepared folder, for paths and poses of its test clips."),
    ] = None,
    captured: Annotated[int, typer.Option("--captured", min=1, help="Test clips of DATA.")] = 140,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Motions of each drawn shape at each speed.")] = 5,
    settings: evaluating.Settings = None,
    threads: Threads = 0,
    output: ReportFolder = None,
    as_json: console.Json = False,
) -> None:
    """Measure how well a bundle's motions meet constraints, and what that costs them. Needs no server."""
    from marey.cli.roles.constraining import measure_constraints

    _measure(lambda how: measure_constraints(bundle, data, captured, how), seeds, settings, threads, output, as_json)


def _measure(
    measure: Callable[[MeasureOptions], RefereeReport],
    seeds: int,
    settings: list[str] | None,
    threads: int,
    output: Path | None,
    as_json: bool,
) -> None:
    from marey.cli.roles.actions import MeasureOptions

    with console.bar() as bar:
        task = bar.add_task("judging", total=None)
        values = options.settings_of(settings or ())
        found = measure(
            MeasureOptions(
                seeds, values, threads, output, lambda done, total: bar.update(task, completed=done, total=total)
            )
        )
    if as_json:
        console.result_json(found.document)
    else:
        console.result(found.markdown.rstrip("\n"))
