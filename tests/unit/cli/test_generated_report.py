"""Messages of `marey generate` about a motion that it made."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from marey.cli.commands.generate import _report_rewrite
from tests.support.walker import walker

PROMPT = "he strolls, hands in pockets"


@pytest.mark.parametrize(
    ("manifest", "said"),
    [
        ({"rewritten": "a person walks"}, f"'{PROMPT}' was read as 'a person walks'."),
        (
            {"rewritten": "a person walks", "bearing": [{"name": "hands-in-pockets"}, {"name": "limp"}]},
            f"'{PROMPT}' was read as 'a person walks', with what is drawn on it: hands-in-pockets, limp.",
        ),
        ({"rewritten": PROMPT, "not_rewritten": "no answer"}, f"'{PROMPT}' was read as it is: no answer."),
        ({"rewritten": PROMPT}, ""),
    ],
)
def test_what_was_read_is_said_with_what_is_drawn_on_it(
    manifest: dict[str, Any], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _report_rewrite(replace(walker(), manifest={"prompt": PROMPT, **manifest}))
    captured = capsys.readouterr()
    assert " ".join(captured.err.split()) == said
