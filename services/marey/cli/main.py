"""The commands of `marey`. Each module of `commands` imports its dependencies when it runs."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from marey.cli import console, hints
from marey.cli.commands import (
    admin,
    convert,
    data,
    edit,
    evaluations,
    fetch,
    generate,
    jobs,
    models,
    review,
    rigs,
    serve,
    streams,
    submit,
    takes,
    text,
    train,
    webhooks,
)
from marey.cli.operations import OperationsCommand
from marey.core import tracing
from marey.core.errors import InvalidInput, MareyError
from marey.core.garbage import end_without_collection
from marey.core.package import own_version
from marey.core.validation import problem_of

SERVING = frozenset({"serve", "worker", "scheduler", "api", "probe", "text", "train", "data"})
CHOSEN = "marey.command"
"""Key of the context: the command that was chosen."""
WORDS = "marey.words"
"""Key of the context: the words of the command line behind the name of the command."""
OF_THE_DISK = frozenset(
    {
        errno.EACCES, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOSPC,
        errno.ENOTDIR, errno.EPERM, errno.EROFS,
    }
)  # fmt: skip
"""Refusals of a file system that are no bug of ours; a file that is missing may be one."""
FULL = frozenset({errno.EDQUOT, errno.EFBIG, errno.ENOSPC})
"""Refusals of a disk without room; libraries that write do not say the name of the file."""
PATIENCE = 2.0
"""Seconds that a command waits at its end for a trace collector that does not answer."""

HELP = """Text in, 3D human motion out.

Exit codes: 0 all succeeded; 1 internal error; 2 usage or invalid input; 3 not found; 4 unreachable; 5 refused;
6 ended with failed, dead or cancelled items; 7 --timeout passed; 8 evaluation regressed; 130 interrupted, or
answered with no."""


def _options_of(command: Any) -> Mapping[str, str]:
    """Return how a user names each parameter of a command (`--keep-days`, `PRIORITY`), by the names in errors."""
    found: dict[str, str] = {}
    for parameter in getattr(command, "params", ()):
        option = max(parameter.opts, key=len)
        shown = option if option.startswith("-") else parameter.metavar or parameter.name.upper()
        for name in (parameter.name, option.lstrip("-").replace("-", "_"), shown.lower()):
            found[name] = shown.rstrip("…")
    return found


def _said(error: ValueError) -> str:
    """Return what is wrong with the value of an option, which pydantic reads."""
    errors: Callable[[], Sequence[Mapping[str, Any]]] | None = getattr(error, "errors", None)
    return str(error) if errors is None else problem_of(errors()[0])


class Commands(TyperGroup):
    """Expected errors are printed verbatim and set the exit code, as are paths that the file system refuses; anything
    else is a bug and shows its traceback."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Parse the arguments and run; usage errors quote them."""
        with console.escaped_output():
            return super().main(*args, **options)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return the group or command of the first word, and note the command of all words, for errors."""
        name, command, rest = super().resolve_command(ctx, args)
        chosen, words = command, list(rest)
        while isinstance(chosen, TyperGroup) and words:
            chosen = chosen.get_command(ctx, words.pop(0))
        ctx.meta[CHOSEN], ctx.meta[WORDS] = chosen, words
        return name, command, rest

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if isinstance(error.__cause__, ValueError):
                error.message = _said(error.__cause__)
            raise
        except MareyError as error:
            if isinstance(ctx.obj, tracing.Span):
                ctx.obj.fail(error)
            named = hints.name_options(error, _options_of(ctx.meta.get(CHOSEN)), ctx.meta.get(WORDS, ()))
            console.say(f"marey: {named}")
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            console.say("marey: interrupted")
            raise typer.Exit(console.INTERRUPTED) from None
        except BrokenPipeError:
            sys.stderr.close()  # the reader of our output left; Python would complain at exit
            raise typer.Exit(0) from None
        except OSError as error:
            if error.errno not in (FULL if error.filename is None else OF_THE_DISK):
                raise
            name = "a file cannot be written" if error.filename is None else os.fsdecode(error.filename)
            console.say(f"marey: {name}: {error.strerror}")
            raise typer.Exit(InvalidInput.exit_code) from None


app = typer.Typer(
    cls=Commands,
    help=HELP,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        console.result(own_version())
        raise typer.Exit(0)


def _trace(ctx: typer.Context) -> None:
    """Make the command the root of a trace, where traces are wanted; a server's processes begin traces of their own."""
    command = ctx.invoked_subcommand
    if command is None or command in SERVING or not tracing.wanted():
        return
    try:
        tracing.configure_tracing("cli", patience=PATIENCE)
    except MareyError as error:
        console.say(f"marey: this command is not traced: {error}")  # and runs: it is not what was asked for
        return
    ctx.call_on_close(tracing.end_tracing)
    ctx.obj = ctx.with_resource(tracing.span(f"marey {command}"))


@app.callback()
def root(
    ctx: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Begin the trace of the command; `HELP` has the help text."""
    _trace(ctx)


app.command("generate")(generate.generate)
app.command("submit")(submit.submit)
app.add_typer(jobs.app, name="jobs")
app.add_typer(takes.app, name="motions")
app.command("review")(review.review)
app.command("fetch")(fetch.fetch)
app.command("stream")(streams.stream)
app.command("serve")(serve.serve)
app.command("worker")(serve.worker)
app.command("scheduler")(serve.scheduler)
app.command("api")(serve.api)
app.command("probe")(serve.probe)
app.add_typer(text.app, name="text")
app.add_typer(models.app, name="models")
app.add_typer(rigs.app, name="rigs")
app.add_typer(data.app, name="data")
app.add_typer(train.app, name="train")
app.add_typer(evaluations.app, name="eval")
app.add_typer(webhooks.app, name="webhooks")
app.command("convert")(convert.convert)
app.command("render")(convert.render)
app.command("edit", cls=OperationsCommand)(edit.edit)
app.command("doctor")(admin.doctor)
app.add_typer(admin.app, name="admin")


def run() -> None:
    """The console script."""
    console.escape_output()  # also of the traceback of a bug, which is written when all else has ended
    end_without_collection()
    try:
        app()
    except KeyboardInterrupt:  # before or after the command itself
        console.say("marey: interrupted")
        raise SystemExit(console.INTERRUPTED) from None
