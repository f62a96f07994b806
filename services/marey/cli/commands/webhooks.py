"""`marey webhooks …`."""

from __future__ import annotations

from collections.abc import Mapping
from operator import getitem
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from marey.cli import bulk, console
from marey.cli.hints import hint_of_timeout
from marey.cli.references import FORMS, find, find_all, of_view
from marey.core.errors import ItemsFailed

if TYPE_CHECKING:
    from marey.client import DeliveryDetail, Webhook

app = typer.Typer(
    help="Signed messages to your own server when jobs, streams and evaluations end.", no_args_is_help=True
)

COLUMNS = ("id", "name", "url", "events", "paused", "pending", "failed")
DELIVERY_COLUMNS = ("event", "kind", "state", "attempts", "status", "created", "next", "error")
ATTEMPT_COLUMNS = ("number", "at", "status", "seconds", "error")
DELIVERIES = "Deliveries: the id of the event, its last 8 digits, or last."

DeliveryState = Literal["pending", "delivered", "failed"]
Id = Annotated[str, typer.Argument(metavar="WEBHOOK", help=f"The webhook: {FORMS}.")]
Ids = Annotated[list[str], typer.Argument(metavar="WEBHOOK…", help=f"Webhooks: of each {FORMS}.")]


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
    from marey.client import Client

    with Client() as client:
        made = client.webhooks.create(url, events=events, name=name)
    if as_json:
        console.result_json(made.raw)
    else:
        console.result(f"{made.id}\t{made.secret}")
        console.say("The secret is shown only now; the receiver checks signatures with it.")


@app.command("list")
def list_webhooks(full_ids: console.FullIds = False, as_json: console.Json = False) -> None:
    """List webhooks, newest first."""
    from marey.client import Client

    with Client() as client:
        console.listing(
            (each.raw for each in client.webhooks.list()), COLUMNS, _cell, as_json=as_json, full_ids=full_ids
        )


@app.command()
def show(webhook: Id, as_json: console.Json = False) -> None:
    """Show a webhook."""
    from marey.client import Client

    with Client() as client:
        found = client.webhooks.get(find(client, "webhook", webhook).id).raw
    if as_json:
        console.result_json(found)
        return
    for column in (*COLUMNS, "created"):
        console.result(f"{column:<10}{_cell(found, column) or ''}")


@app.command()
def pause(webhooks: Ids, as_json: console.Json = False) -> None:
    """Pause deliveries; messages wait meanwhile."""
    bulk.change_all("webhook", webhooks, lambda client, each: client.webhooks.pause(each), _state, as_json=as_json)


@app.command()
def resume(webhooks: Ids, as_json: console.Json = False) -> None:
    """Resume deliveries, waiting messages first."""
    bulk.change_all("webhook", webhooks, lambda client, each: client.webhooks.resume(each), _state, as_json=as_json)


@app.command()
def rotate(
    webhook: Id,
    overlap_hours: Annotated[
        float, typer.Option("--overlap-hours", min=0, max=720, help="Hours during which the old secret signs as well.")
    ] = 24,
    as_json: console.Json = False,
) -> None:
    """Replace the signing secret and print the new one once. Until the overlap ends messages carry both signatures."""
    from marey.client import Client

    with Client() as client:
        made = client.webhooks.rotate(find(client, "webhook", webhook).id, overlap_hours=overlap_hours)
    if as_json:
        console.result_json(made.raw)
    else:
        console.result(made.secret)
        console.say(f"Give it to the receiver; the one before it works for {overlap_hours:g} hours more.")


@app.command()
def remove(webhooks: Ids, yes: console.Yes = False) -> None:
    """Remove webhooks with their deliveries and log."""
    bulk.delete_all(
        "webhook", webhooks, lambda client, each: client.webhooks.delete(each.id),
        question="Remove {}?", done="removed {}", yes=yes,
    )  # fmt: skip


@app.command()
def deliveries(
    webhook: Id,
    event: Annotated[
        str | None, typer.Argument(metavar="[EVENT]", help="Show every attempt of this delivery.", show_default=False)
    ] = None,
    state: Annotated[DeliveryState | None, typer.Option("--state", help="Only deliveries in this state.")] = None,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List a webhook's deliveries of the last 30 days, newest first; or the attempts of one delivery."""
    from marey.client import Client

    with Client() as client:
        webhook = find(client, "webhook", webhook).id
        if event is not None:
            found = client.webhooks.delivery(webhook, find(client, "delivery", event, webhook=webhook).id)
            _show_attempts(found, as_json)
            return
        pages = client.webhooks.deliveries(webhook, state=state, page_size=console.page_size(limit))
        console.listing(
            (each.raw for each in pages), DELIVERY_COLUMNS, getitem, as_json=as_json, limit=limit, full_ids=full_ids
        )


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
    from marey.client import Client

    with Client() as client:
        webhook = find(client, "webhook", webhook).id
        given = [each.id for each in find_all(client, "delivery", events or (), webhook=webhook)]
        wanted = given or [each.event for each in client.webhooks.deliveries(webhook, state="failed")]
        for event in wanted:
            found = client.webhooks.replay(webhook, event)
            if as_json:
                console.result_json(found.raw)
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
    from marey.client import Client

    with Client() as client:
        webhook = find(client, "webhook", webhook).id
        found = client.webhooks.test(webhook)
        if wait:
            with hint_of_timeout(f"Check that a scheduler runs. Later: `marey webhooks deliveries {webhook}`."):
                found = client.webhooks.wait(found, timeout=timeout)
    if as_json:
        console.result_json(found.raw)
    else:
        console.result(found.event)
    if found.state == "failed":
        raise ItemsFailed(f"it did not arrive: {found.error}", where=f"webhook {webhook}")
    if found.state == "delivered":
        console.say(f"it arrived: {found.status}")


def _show_attempts(found: DeliveryDetail, as_json: bool) -> None:
    if as_json:
        console.result_json(found.raw)
        return
    console.table(ATTEMPT_COLUMNS, ([each.raw[column] for column in ATTEMPT_COLUMNS] for each in found.log))
    following = f", next attempt at {found.raw['next']}" if found.next else ""
    console.say(f"{found.kind} is {found.state}{following}")


def _state(webhook: Webhook) -> str:
    return f"{of_view('webhook', webhook.raw)} {'is paused' if webhook.paused else 'goes on'}"


def _cell(webhook: Mapping[str, Any], column: str) -> object:
    if column == "events":
        return ", ".join(webhook[column])
    return {True: "paused", False: None}[webhook[column]] if column == "paused" else webhook[column]
