"""A headless Chromium, where the machine has one: opens a page, gives back its DOM or a picture."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--enable-logging=stderr",
)


@dataclass(frozen=True)
class Chromium:
    program: str
    folder: Path  # for the profile and the pictures

    def _run(self, page: Path, fragment: str, *options: str, quiet: bool = True) -> subprocess.CompletedProcess[str]:
        command = [
            self.program,
            *OPTIONS,
            "--window-size=1200,800",
            "--virtual-time-budget=3000",
            f"--user-data-dir={self.folder / 'profile'}",
            *options,
            f"{page.as_uri()}#{fragment}",
        ]
        done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=True)
        complaints = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "GL Driver" not in line]
        assert not (quiet and complaints), complaints
        return done

    def dom(self, page: Path, fragment: str = "", *, quiet: bool = True) -> str:
        """The page's HTML after its scripts ran for some seconds; `quiet` pages have nothing to say on the console."""
        return self._run(page, fragment, "--dump-dom", quiet=quiet).stdout

    def picture(self, page: Path, fragment: str = "") -> NDArray[np.uint8]:
        """A screenshot, (800, 1200, 3)."""
        target = self.folder / "window.png"
        self._run(page, fragment, f"--screenshot={target}")
        with Image.open(target) as image:
            return np.asarray(image.convert("RGB"))


def find(folder: Path) -> Chromium:
    """The one named by MAREY_CHROMIUM or found on the path; skips the test when there is none."""
    named = os.environ.get("MAREY_CHROMIUM")
    program = named or next((found for name in NAMES if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip("there is no Chromium here (install one, or name it in MAREY_CHROMIUM)")
    return Chromium(program, folder)
