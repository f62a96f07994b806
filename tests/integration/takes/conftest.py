"""`marey` with the API of a module as its server."""

from __future__ import annotations

import pytest

from tests.support.command import Command
from tests.support.live_api import LiveApi


@pytest.fixture
def marey(api: LiveApi) -> Command:
    return Command({"MAREY_SERVER": api.url, "MAREY_KEY": api.key})
