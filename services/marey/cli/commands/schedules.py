"""`marey eval schedule …`."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from marey.cli import console, evaluating
from marey.cli.evaluating import Asked
from marey.cli.options import ExtraColumns
from marey.cli.references import FORMS, find, find_all, listed, named, of_view

COLUMNS = ("id", "name", "cron", "time_zone", "next", "bundle", "source", "last_state", "last_regressed")


class Schedules(TyperGroup):
    """A first word that is a cron line is an `add`: no command's name holds a blank, and every such line does."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments name."""
        return super().resolve_command(ctx, ["add", *args] if " " in args[0] else args)


app = typer.Typer(
    cls=Schedules,
    help='Evaluations that come again: `marey eval schedule "0 3 * * 1" --bundle hgm3` is every Monday at 03:00.',
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
    extra_columns: evaluating.Extra = ExtraColumns.REFUSE,
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
    asked = Asked(bundle, evaluator, split, settings, repeats, seed, baseline, extra_columns)
    body = {**asked.body(), "cron": cron, "time_zone": time_zone, **({"name": name} if name else {})}
    from marey.client.transport import Transport

    with Transport.here() as client, asked.in_source():
        if baseline is not None:
            body["baseline"] = find(client, "evaluation", baseline).id
        made = client.post_once("/v1/schedules", body)
    if as_json:
        console.result_json(made)
    else:
        console.result(made["id"])
        console.say(f"first at {made['next']}")


@app.command("list")
def list_schedules(full_ids: console.FullIds = False, as_json: console.Json = False) -> None:
    """List schedules, newest first, with their next times and the results of their last runs."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        found = client.pages("/v1/schedules", limit=console.PAGE)
        console.listing(found, COLUMNS, _cell, as_json=as_json, full_ids=full_ids)


@app.command()
def pause(schedules: Ids, as_json: console.Json = False) -> None:
    """Pause schedules; current runs go on."""
    _change(schedules, as_json, paused=True)


@app.command()
def resume(schedules: Ids, as_json: console.Json = False) -> None:
    """Resume schedules from their next time on; missed times are not made up for."""
    _change(schedules, as_json, paused=False)


@app.command()
def run(schedule: Id, as_json: console.Json = False) -> None:
    """Run a schedule's evaluation now, in addition to its times; prints the run's id."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        made = client.post_once(f"/v1/schedules/{find(client, 'schedule', schedule).id}/run", None)
    if as_json:
        console.result_json(made)
    else:
        console.result(made["id"])


@app.command()
def history(
    schedule: Id,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List the runs of a schedule, newest first."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        wanted = find(client, "schedule", schedule).id
    evaluating.show_runs(f"/v1/schedules/{wanted}/evaluations", limit, as_json, full_ids=full_ids)


@app.command()
def delete(schedules: Ids, yes: console.Yes = False) -> None:
    """Delete schedules; their runs stay."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        found = find_all(client, "schedule", schedules)
        console.confirm(f"Delete {listed(found)}?", yes=yes)
        for each in named(client, "/v1/schedules", found):
            client.delete(f"/v1/schedules/{each.id}")
            console.say(f"deleted {each}")


def _change(schedules: list[str], as_json: bool, **changes: object) -> None:
    from marey.client.transport import Transport

    with Transport.here() as client:
        for each in find_all(client, "schedule", schedules):
            found = client.patch(f"/v1/schedules/{each.id}", changes)
            if as_json:
                console.result_json(found)
            else:
                what = of_view("schedule", found)
                console.say(f"{what} is paused" if found["paused"] else f"{what} is next due at {found['next']}")


def _cell(schedule: dict[str, Any], column: str) -> object:
    if column == "next" and schedule["paused"]:
        return "paused"
    if column == "last_regressed":
        return {True: "regressed", False: "no", None: None}[schedule[column]]
    return schedule["request"][column] if column in ("bundle", "source") else schedule[column]
