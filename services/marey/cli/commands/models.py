"""`marey models …`."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from marey.cli import console

app = typer.Typer(help="Model bundles and weights.", no_args_is_help=True)

WORDS = 4
"""Words that are shown for a supported action."""
Local = Annotated[bool, typer.Option("--local", help="Show the bundles of this machine, not the server's.")]


@app.command("list")
def list_models(local: Local = False, as_json: console.Json = False) -> None:
    """List the bundles of the server, or of this machine if none runs."""
    answer = _local_models() if local or not _server_named() else _server_models()
    found = answer["items"]
    for broken in answer.get("broken", []):  # an older server does not send them
        console.say(f"left out: {broken['name']}: {broken['reason']}")
    if as_json:
        for model in found:
            console.result_json(model)
        return
    columns = ("name", "model", "version", "licence", "length", "weights")
    console.table(columns, ((*(m[c] for c in columns[:4]), _length(m), _weights(m)) for m in found))


@app.command()
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A model, a bundle or an exact bundle.")],
    metrics: Annotated[
        bool, typer.Option("--metrics", help="Show the figures of its training and evaluation.")
    ] = False,
    local: Local = False,
    as_json: console.Json = False,
) -> None:
    """Show one bundle: the actions that it supports, terms, data and settings; figures with --metrics."""
    here = local or "/" in name or not _server_named()  # a folder is one of this machine
    found = _local_model(name) if here else _server_model(name)
    if as_json:
        console.result_json(found)
        return
    for line in _described(found):
        console.result(line)
    for setting in found.get("settings", []):
        kind = "whole, " if setting["whole"] else ""
        shown = f"{setting['name']} = {setting['default']:g} ({kind}{setting['minimum']:g} to {setting['maximum']:g})"
        console.result(f"{'setting':<12} {shown}  {setting['help']}".rstrip())
    if metrics:
        for metric, value in found["metrics"].items():
            console.result(f"{'metric':<12} {metric} = {value:g}")


@app.command()
def quantize(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A model, a bundle, or its folder.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the copy, whose name is the bundle's.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing folder.")] = False,
) -> None:
    """Write a copy of a generator with its matrices in 8 bits: half the size, and slightly other motions."""
    from marey.core.extras import extra

    with extra("worker"):
        from marey.bundles import choose_bundle
        from marey.bundles.eight_bit import write_eight_bit
    made = write_eight_bit(choose_bundle(name), output, overwrite=overwrite)
    console.result(made.reference)


@app.command("import")
def import_bundle(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="Kind of the weights; an unknown one lists those of this machine.")
    ],
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="The published files, unpacked as downloaded.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the bundle, whose name is the bundle's.")],
    text_encoder: Annotated[
        Path | None,
        typer.Option(
            "--text-encoder",
            metavar="PATH",
            help="Folder of the text encoder that the weights were trained with, as the models' hub has it; it is "
            "installed beside the bundle. Default: the installed one.",
        ),
    ] = None,
    licence: Annotated[
        str | None,
        typer.Option(
            "--licence",
            metavar="ID",
            help="Terms of the weights, as an SPDX identifier. Default: those that their source states, if any.",
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing bundle.")] = False,
) -> None:
    """Import published weights as a bundle, offline: every tensor is checked, and code in files is never run."""
    from marey.cli.roles.importing import import_weights

    made = import_weights(kind, folder, output, text_encoder=text_encoder, licence=licence, overwrite=overwrite)
    console.result(made)


def _server_named() -> bool:
    import os

    from marey.client.server_address import home

    return bool(os.environ.get("MAREY_SERVER")) or (home() / "server.json").exists()


def _server_models() -> Mapping[str, Any]:
    from marey.client import Client

    with Client() as client:
        return client.models.catalogue().raw


def _server_model(name: str) -> Mapping[str, Any]:
    from marey.client import Client

    with Client() as client:
        return client.models.get(name).raw


def _local_models() -> dict[str, Any]:
    from marey.core.extras import extra

    with extra("server"):
        from marey.api.models.schemas import ModelsView
        from marey.core.settings import settings
        from marey.jobs.generators import list_generators
    return ModelsView.of(list_generators(settings())).model_dump(mode="json")


def _local_model(name: str) -> dict[str, Any]:
    from marey.core.extras import extra

    with extra("server"):
        from marey.api.catalogue import Catalogue
        from marey.api.models.schemas import ModelView
        from marey.core.settings import settings
    return ModelView.of(Catalogue(settings()).capabilities(name)).model_dump(mode="json")


def _length(model: Mapping[str, Any]) -> str:
    return f"{model['min_seconds']:g} to {model['max_seconds']:g} s"


def _described(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines about a bundle, without settings and metrics: first what a prompt may ask for."""
    facts = {**found, "length": _length(found), "weights": _weights(found)}
    for field in ("name", "licence", "length", "weights"):
        yield f"{field:<12} {facts[field]}"
    yield from _actions(found.get("actions"))
    yield ""
    for field in ("bundle", "model", "version", "config", "skeleton", "fps", "encoder"):
        yield f"{field:<12} {facts[field]}"
    for source in found["data"]:
        yield f"{'data':<12} {source['name']} ({source['licence']}): {source['credit']}"
    for line in found.get("about", "").splitlines():  # an older server does not send it
        yield f"{'about':<12} {line}"


def _actions(lists: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield lines about the lists of actions: a supported one has a line with words that ask for it."""
    if lists is None:
        yield f"{'actions':<12} not listed: prompts are not compared with what it supports"
        return
    supported, few, tried = (lists.get(field, ()) for field in ("supported", "single_take", "tried"))
    width = max(map(len, (*supported, *few)), default=0)
    for title, names in (("Supported actions", supported), ("Supported, but learned from few captures", few)):
        if names:
            yield from ("", f"{title}, and words that ask for them:")
            yield from (f"  {name:<{width}}  {_words_for(name)}".rstrip() for name in names)
    if tried:
        columns = shutil.get_terminal_size((100, 24)).columns
        yield from ("", "Tried actions, which may come out wrong:")
        yield from textwrap.wrap(
            ", ".join(tried), max(columns, 40), initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False
        )


def _words_for(action: str) -> str:
    """Return the first words of the vocabulary for an action; none if this release does not know it."""
    from marey.vocabulary.entries import load_vocabulary

    known = load_vocabulary().actions.get(action)
    return "" if known is None else ", ".join(known.verbs[:WORDS])


def _weights(model: Mapping[str, Any]) -> str:
    return "random: never trained" if model["random"] else "trained"
