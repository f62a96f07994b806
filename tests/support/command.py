"""`marey` in this process: a process for each command of a test file would take a minute."""

from __future__ import annotations

from dataclasses import dataclass

from typer.testing import CliRunner

from marey.cli.main import app
from tests.support.marey import Ran


@dataclass(frozen=True)
class Command:
    """The command line with these variables set."""

    environment: dict[str, str]

    def __call__(self, *arguments: object, stdin: str = "") -> Ran:
        """Run a command to its end."""
        done = CliRunner().invoke(app, list(map(str, arguments)), env=self.environment, input=stdin)
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        return Ran(done.exit_code, done.stdout, done.stderr)
