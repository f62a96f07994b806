"""A model from a package of its own: trained, served and fetched from, without an edit of the product."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marey.motion.clip import load_npz
from tests.support.marey import Marey

from .conftest import TRAINED


def test_the_product_alone_does_not_know_it(installed: Marey) -> None:
    alone = Marey(installed.home, installed.models)
    alone("generate", "a person stands", "--bundle", TRAINED).refused(2, "which does not run here", "hgm3")
    alone("worker", "sway").refused(2, "there is no worker 'sway'")


def test_it_is_shown_with_its_settings(served: Marey) -> None:
    shown = served("models", "show", "sway").ok().out
    assert "Stands where training clips stand on average" in shown
    assert "width = 0.1 (0 to 0.5)  Metres from side to side." in shown
    assert "beats = 2 (whole, 1 to 8)" in shown
    assert "metric" not in shown
    assert "pose/height" in served("models", "show", "sway", "--metrics").ok().out


def test_what_is_submitted_to_it_is_fetched(served: Marey, tmp_path: Path) -> None:
    table = "prompt,name,seconds,seed,settings\na person stands,calm,2,0,width=0\na person stands,wild,2,0,\n"
    lines = served(
        "submit", "-f", "-", "--model", "sway", "--set", "width=0.4", "--set", "beats=3",
        "--fetch", tmp_path, "--json", stdin=table,
    ).ok().lines  # fmt: skip
    assert [line["model"] for line in lines] == ["sway", "sway"]
    calm, wild = (load_npz(line["files"]["npz"]) for line in lines)
    assert wild.manifest["settings"] == {"width": 0.4, "beats": 3}
    assert calm.manifest["settings"] == {"width": 0.0, "beats": 3}
    sideways = [np.ptp(clip.joints[:, 0], axis=0).max() for clip in (calm, wild)]
    assert sideways[0] < 0.02 < 0.3 < sideways[1]


TABLE = "prompt,settings\na person stands,width=0.2\na person stands,beats=2.5\na person stands,steps=3\n"


def test_a_setting_out_of_its_range_is_refused_with_the_line(served: Marey) -> None:
    served("submit", "-f", "-", "--model", "sway", stdin=TABLE).refused(
        2, "line 3: settings: beats: is 2.5, not a whole number", "line 4: settings: unknown setting 'steps' of sway-"
    )


def test_a_client_without_the_plugin_leaves_its_settings_to_the_server(served: Marey) -> None:
    client = Marey(served.home, served.models)
    client("submit", "-f", "-", "--model", "sway", stdin=TABLE).refused(
        2, "line 3: settings: beats: is 2.5, not a whole number", "line 4: settings: unknown setting 'steps' of sway-"
    )


def test_a_client_with_the_plugin_asks_no_server_for_ranges(installed: Marey, tmp_path: Path) -> None:
    alone = Marey(tmp_path, installed.models, installed.environment)
    alone("submit", "a person stands", "--model", "sway", "--set", "beats=2.5", "--seconds", 20).refused(
        2, "seconds: 20 is outside 0.8 to 9.8 seconds, the range of sway", "beats: is 2.5, not a whole number"
    )


def test_it_generates_without_a_server(installed: Marey, tmp_path: Path) -> None:
    made = installed(
        "generate", "a person stands", "--model", "sway", "--seed", 1, "--set", "width=0.3", "-o", tmp_path, "--json"
    ).ok()  # fmt: skip
    assert load_npz(made.lines[0]["files"]["npz"]).manifest["settings"] == {"width": 0.3, "beats": 2}
    installed("generate", "a person stands", "--model", "sway", "--set", "width=3").refused(
        2, "width: 3 is outside 0 to 0.5"
    )


def test_what_it_cannot_do_is_told(installed: Marey) -> None:
    installed("worker", "sway", "--only", "live").refused(2, "names 0 models that stream")
