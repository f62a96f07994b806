"""`marey eval schedule …`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from marey.cli import bulk, console, evaluating
from marey.cli.evaluating import EvaluationArguments
from marey.cli.references import FORMS, find, of_view

if TYPE_CHECKING:
    from marey.client import Schedule

COLUMNS = ("id", "name", "cron", "time_zone", "next", "bundle", "source", "last_state", "last_regressed")


class ScheduleGroup(TyperGroup):
    """Commands, and cron expressions in the place of one: these hold a blank, and mean `add`."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the arguments name."""
        return super().resolve_command(ctx, ["add", *args] if " " in args[0] else args)


app = typer.Typer(
    cls=ScheduleGroup,
    help='Repeated evaluations: `marey eval schedule "0 3 * * 1" --bundle hgm3` is every Monday at 03:00.',
    no_args_is_help=True,
)

Id = Annotated[str, typer.Argument(metavar="SCHEDULE", help=f"The schedule: {FORMS}.")]
Ids = Annotated[list[str], typer.Argument(metavar="SCHEDULE…", help=f"Schedules: of each {FORMS}.")]


@app.command()
def add(
    cron: Annotated[
        str,
        typer.Argument(
            metavar="CRON", help="Cron expression in quotes: minute, hour, day of the month, month, day of the week."
        ),
    ],
    bundle: evaluating.Bundle,
    split: evaluating.Split = evaluating.TEST,
    extra_columns: evaluating.Extra = "refuse",
    evaluator: evaluating.Evaluator = None,
    settings: evaluating.Settings = None,
    repeats: evaluating.Repeats = None,
    regenerate: evaluating.Regenerate = False,
    seed: evaluating.Seed = None,
    baseline: evaluating.Baseline = None,
    name: Annotated[str | None, typer.Option("--name", help="A name for the schedule and its runs.")] = None,
    time_zone: Annotated[str, typer.Option("--time-zone", help="Time zone, such as Europe/Berlin.")] = "UTC",
    as_json: console.Json = False,
) -> None:
    """Evaluate a model on a schedule; prints the schedule's id. Each run looks up the bundles by the names given
    here."""
    repeats = evaluating.repeats_of(repeats, regenerate=regenerate)
    asked = EvaluationArguments(bundle, evaluator, split, settings, repeats, seed, baseline, extra_columns)
    wanted = asked.options()
    from marey.client import Client

    with Client() as client:
        wanted["baseline"] = asked.baseline_of(client)
        made = client.schedules.create(cron, bundle, time_zone=time_zone, name=name, **wanted)
    if as_json:
        console.result_json(made.raw)
    else:
        console.result(made.id)
        console.say(f"first at {made.raw['next']}")


@app.command("list")
def list_schedules(full_ids: console.FullIds = False, as_json: console.Json = False) -> None:
    """List schedules, newest first, with their next times and the results of their last runs."""
    from marey.client import Client

    with Client() as client:
        console.listing(
            (each.raw for each in client.schedules.list()), COLUMNS, _cell, as_json=as_json, full_ids=full_ids
        )


@app.command()
def pause(schedules: Ids, as_json: console.Json = False) -> None:
    """Pause schedules; current runs go on."""
    bulk.change_all("schedule", schedules, lambda client, each: client.schedules.pause(each), _state, as_json=as_json)


@app.command()
def resume(schedules: Ids, as_json: console.Json = False) -> None:
    """Resume schedules from their next time on; missed times are not made up for."""
    bulk.change_all("schedule", schedules, lambda client, each: client.schedules.resume(each), _state, as_json=as_json)


@app.command()
def run(schedule: Id, as_json: console.Json = False) -> None:
    """Run a schedule's evaluation now, in addition to its times; prints the run's id."""
    from marey.client import Client

    with Client() as client:
        made = client.schedules.run(find(client, "schedule", schedule).id)
    if as_json:
        console.result_json(made.raw)
    else:
        console.result(made.id)


@app.command()
def history(
    schedule: Id,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List the runs of a schedule, newest first."""
    from marey.client import Client

    with Client() as client:
        found = client.schedules.runs(find(client, "schedule", schedule).id, page_size=console.page_size(limit))
        evaluating.show_runs(found, limit, as_json, full_ids=full_ids)


@app.command()
def delete(schedules: Ids, yes: console.Yes = False) -> None:
    """Delete schedules; their runs stay."""
    bulk.delete_all(
        "schedule", schedules, lambda client, each: client.schedules.delete(each.id),
        question="Delete {}?", done="deleted {}", yes=yes,
    )  # fmt: skip


def _state(schedule: Schedule) -> str:
    due = "is paused" if schedule.paused else f"is next due at {schedule.raw['next']}"
    return f"{of_view('schedule', schedule.raw)} {due}"


def _cell(schedule: Mapping[str, Any], column: str) -> object:
    if column == "next" and schedule["paused"]:
        return "paused"
    if column == "last_regressed":
        return evaluating.regressed_cell(schedule[column])
    return schedule["request"][column] if column in ("bundle", "source") else schedule[column]
