"""`marey webhooks …`."""

from __future__ import annotations

import time
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console
from marey.cli.references import FORMS, find, find_all, listed, named, of_view
from marey.core.errors import ItemsFailed, TimedOut

if TYPE_CHECKING:
    from marey.client.transport import Transport

app = typer.Typer(
    help="Signed messages to your own server when jobs, streams and evaluations end.", no_args_is_help=True
)

COLUMNS = ("id", "name", "url", "events", "paused", "pending", "failed")
DELIVERY_COLUMNS = ("event", "kind", "state", "attempts", "status", "created", "next", "error")
LOOK_SECONDS = 0.25
DELIVERIES = "Deliveries: the id of the event, its last 8 digits, or last."

Id = Annotated[str, typer.Argument(metavar="WEBHOOK", help=f"The webhook: {FORMS}.")]
Ids = Annotated[list[str], typer.Argument(metavar="WEBHOOK…", help=f"Webhooks: of each {FORMS}.")]


class State(StrEnum):
    """State of a delivery."""

    PENDING = "pending"
    DELIVERED = "delivered"
    FAILED = "failed"


@app.command()
def add(
    url: Annotated[str, typer.Argument(metavar="URL", help="The https address of your server.")],
    events: Annotated[
        list[str] | None,
        typer.Option("--event", help="An event type, such as job.ended; may be repeated. Default: all."),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="A name for it.")] = None,
    as_json: console.Json = False,
) -> None:
    """Subscribe to events from now on; prints the webhook's id and, once, its signing secret."""
    body = {"url": url, **({"events": events} if events else {}), **({"name": name} if name else {})}
    from marey.client.transport import Transport

    with Transport.here() as client:
        made = client.post_once("/v1/webhooks", body)
    if as_json:
        console.result_json(made)
    else:
        console.result(f"{made['id']}\t{made['secret']}")
        console.say("The secret is shown only now; the receiver checks signatures with it.")


@app.command("list")
def list_webhooks(full_ids: console.FullIds = False, as_json: console.Json = False) -> None:
    """List webhooks, newest first."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        found = client.pages("/v1/webhooks", limit=console.PAGE)
        console.listing(found, COLUMNS, _cell, as_json=as_json, full_ids=full_ids)


@app.command()
def show(webhook: Id, as_json: console.Json = False) -> None:
    """Show a webhook."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        found = client.get(f"/v1/webhooks/{find(client, 'webhook', webhook).id}")
    if as_json:
        console.result_json(found)
        return
    for column in (*COLUMNS, "created"):
        console.result(f"{column:<10}{_cell(found, column) or ''}")


@app.command()
def pause(webhooks: Ids, as_json: console.Json = False) -> None:
    """Pause deliveries; messages wait meanwhile."""
    _change(webhooks, as_json, paused=True)


@app.command()
def resume(webhooks: Ids, as_json: console.Json = False) -> None:
    """Resume deliveries, waiting messages first."""
    _change(webhooks, as_json, paused=False)


@app.command()
def rotate(
    webhook: Id,
    overlap_hours: Annotated[
        float, typer.Option("--overlap-hours", min=0, max=720, help="Hours during which the old secret signs as well.")
    ] = 24,
    as_json: console.Json = False,
) -> None:
    """Replace the signing secret and print the new one once. Until the overlap ends messages carry both signatures."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        webhook = find(client, "webhook", webhook).id
        made = client.post_once(f"/v1/webhooks/{webhook}/rotate?overlap_hours={overlap_hours:g}", None)
    if as_json:
        console.result_json(made)
    else:
        console.result(made["secret"])
        console.say(f"Give it to the receiver; the one before it works for {overlap_hours:g} hours more.")


@app.command()
def remove(webhooks: Ids, yes: console.Yes = False) -> None:
    """Remove webhooks with their deliveries and log."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        found = find_all(client, "webhook", webhooks)
        console.confirm(f"Remove {listed(found)}?", yes=yes)
        for each in named(client, "/v1/webhooks", found):
            client.delete(f"/v1/webhooks/{each.id}")
            console.say(f"removed {each}")


@app.command()
def deliveries(
    webhook: Id,
    event: Annotated[
        str | None, typer.Argument(metavar="[EVENT]", help="Show every attempt of this delivery.", show_default=False)
    ] = None,
    state: Annotated[State | None, typer.Option("--state", help="Only deliveries in this state.")] = None,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List a webhook's deliveries of the last 30 days, newest first; or the attempts of one delivery."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        webhook = find(client, "webhook", webhook).id
        if event is not None:
            event = find(client, "delivery", event, webhook=webhook).id
            _show_tries(client.get(f"/v1/webhooks/{webhook}/deliveries/{event}"), as_json)
            return
        wanted = {"state": state.value} if state else {}
        pages = client.pages(f"/v1/webhooks/{webhook}/deliveries", limit=console.page_size(limit), **wanted)
        console.listing(pages, DELIVERY_COLUMNS, dict.__getitem__, as_json=as_json, limit=limit, full_ids=full_ids)


@app.command()
def replay(
    webhook: Id,
    events: Annotated[
        list[str] | None,
        typer.Argument(metavar="EVENT…", help=DELIVERIES, show_default=False),
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="All deliveries without attempts left.")] = False,
    as_json: console.Json = False,
) -> None:
    """Deliver events again, under the same ids and with all attempts."""
    if bool(events) == failed:
        raise typer.BadParameter("give ids of events, or --failed")
    from marey.client.transport import Transport

    with Transport.here() as client:
        webhook = find(client, "webhook", webhook).id
        path = f"/v1/webhooks/{webhook}/deliveries"
        given = [each.id for each in find_all(client, "delivery", events or (), webhook=webhook)]
        wanted = given or [each["event"] for each in client.pages(path, limit=1000, state="failed")]
        for event in wanted:
            found = client.post(f"{path}/{event}/replay")
            if as_json:
                console.result_json(found)
    if not as_json:
        console.say(f"{len(wanted)} deliveries are made again")


@app.command("test")
def send_test(
    webhook: Id,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the attempt; exit 6 if it did not arrive.")] = False,
    timeout: Annotated[
        float, typer.Option("--timeout", min=0, help="Timeout in seconds; exit 7 when it passes.")
    ] = 60.0,
    as_json: console.Json = False,
) -> None:
    """Send a message of type `webhook.test` once; prints its id."""
    from marey.client.transport import Transport

    with Transport.here() as client:
        webhook = find(client, "webhook", webhook).id
        found = client.post_once(f"/v1/webhooks/{webhook}/test", None)
        if wait:
            found = _tried(client, found, timeout)
    if as_json:
        console.result_json(found)
    else:
        console.result(found["event"])
    if found["state"] == State.FAILED:
        raise ItemsFailed(f"it did not arrive: {found['error']}", where=f"webhook {webhook}")
    if found["state"] == State.DELIVERED:
        console.say(f"it arrived: {found['status']}")


def _tried(client: Transport, found: dict[str, Any], timeout: float) -> dict[str, Any]:
    """A delivery once it has ended.

    Raises:
        TimedOut: it has not.
    """
    ends = time.monotonic() + timeout
    while found["state"] == State.PENDING:
        if time.monotonic() > ends:
            raise TimedOut(
                "no attempt was made in time",
                where=f"webhook {found['webhook']}",
                hint=f"Does a scheduler run? Later: `marey webhooks deliveries {found['webhook']}`.",
            )
        time.sleep(LOOK_SECONDS)
        found = client.get(f"/v1/webhooks/{found['webhook']}/deliveries/{found['event']}")
    return found


def _show_tries(found: dict[str, Any], as_json: bool) -> None:
    if as_json:
        console.result_json(found)
        return
    columns = ("number", "at", "status", "seconds", "error")
    console.table(columns, ([each[column] for column in columns] for each in found["log"]))
    following = f", next try at {found['next']}" if found["next"] else ""
    console.say(f"{found['kind']} is {found['state']}{following}")


def _change(webhooks: list[str], as_json: bool, *, paused: bool) -> None:
    from marey.client.transport import Transport

    with Transport.here() as client:
        for each in find_all(client, "webhook", webhooks):
            found = client.patch(f"/v1/webhooks/{each.id}", {"paused": paused})
            if as_json:
                console.result_json(found)
            else:
                what = of_view("webhook", found)
                console.say(f"{what} is paused" if found["paused"] else f"{what} goes on")


def _cell(webhook: dict[str, Any], column: str) -> object:
    if column == "events":
        return ", ".join(webhook[column])
    return {True: "paused", False: None}[webhook[column]] if column == "paused" else webhook[column]
