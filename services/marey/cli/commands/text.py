"""`marey text …`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console, options
from marey.cli.commands.submit import read_prompts
from marey.client.rows import right_items
from marey.core import defaults
from marey.core.garbage import no_collection
from marey.core.private_home import UMASK

if TYPE_CHECKING:
    from collections.abc import Iterator

app = typer.Typer(help="Prompts and their semantic graphs.", no_args_is_help=True)

BATCH = 64


@app.command()
def parse(
    prompts: options.Prompts = None,
    file: options.PromptFile = None,
    input_format: options.PromptFormat = None,
    model: Annotated[
        str, typer.Option("--model", help="Model or bundle whose labeller and rewriter to use.")
    ] = defaults.MODEL,
    as_json: console.Json = False,
) -> None:
    """Show the graph of a prompt. Needs no server."""
    from marey.core.extras import extra

    texts = [item.prompt for item in right_items(read_prompts(prompts, file, input_format))]
    with extra("worker"):
        for graph in _graphs(texts, model):
            if as_json:
                console.result_json(graph)
            else:
                draw(graph)


@app.command()
def serve(
    path: Annotated[
        Path | None, typer.Option("--socket", help="Unix socket to listen on, instead of MAREY_HOST and MAREY_PORT.")
    ] = None,
) -> None:
    """Run the text service, which parses prompts for the API; MAREY_TEXT_KEY is their shared secret."""
    os.umask(UMASK)
    from marey.core.extras import extra

    with extra("worker"), no_collection():
        from marey.text_service.server import serve_text
    serve_text(path)


def _graphs(texts: list[str], model: str) -> Iterator[dict[str, Any]]:
    from marey.bundles import choose_bundle
    from marey.core.errors import InvalidInput
    from marey.text.keys import as_served
    from marey.text.pipeline import TextPipeline

    spec = choose_bundle(model, verify=False).manifest.text
    if spec is None:
        raise InvalidInput(f"{model!r} does not read prompts", hint="Name a generator.")
    pipeline = TextPipeline.load(as_served(spec))
    for start in range(0, len(texts), BATCH):
        for parsed in pipeline.explain(texts[start : start + BATCH]):
            yield parsed.to_json()


def draw(graph: dict[str, Any]) -> None:
    """Print a parsed prompt as indented text."""
    names = {node["id"]: node["text"] for node in graph["nodes"]}
    console.result(f"prompt: {graph['prompt']}")
    if graph["text"] != graph["prompt"]:
        console.result(f"read as: {graph['text']}")
    if graph["rewrite_reason"] is not None:
        console.result(f"why: {graph['rewrite_reason']}")
    for number, movement in enumerate(graph["movements"], 1):
        console.result(f"movement {number}: {movement}")
    for node in graph["nodes"]:
        if node["level"] == "action":
            console.result(f"  {node['text']}")
            for edge in graph["edges"]:
                if edge["from"] == node["id"]:
                    console.result(f"    {edge['role'] or edge['type']}: {names[edge['to']]}")
    for warning in graph["warnings"]:
        console.result(f"warning: {warning}")
