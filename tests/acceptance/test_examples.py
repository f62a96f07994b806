"""The scripts of `examples/`, each as a user runs it, against a real server."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.support.marey import REPOSITORY, Marey

EXAMPLES = REPOSITORY / "examples"


def run(marey: Marey, folder: Path, script: str, *arguments: object, code: int = 0, timeout: float = 120) -> str:
    """Run a script in a folder; what it printed, on stderr if it is to fail."""
    command = [sys.executable, str(EXAMPLES / script), *map(str, arguments)]
    done = subprocess.run(
        command, cwd=folder, env=marey.environ(), capture_output=True, text=True, timeout=timeout, check=False
    )
    assert done.returncode == code, f"exit {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stderr if code else done.stdout


def test_a_csv_is_submitted_and_fetched(elsewhere: Marey, tmp_path: Path) -> None:
    (tmp_path / "prompts.csv").write_text("prompt,seed\na person walks,3\na person waves,4\n")
    out = run(elsewhere, tmp_path, "submit_csv.py", "prompts.csv", "clips").splitlines()
    assert out == ["3 clips/00000_a-person-walks_3.bvh", "4 clips/00001_a-person-waves_4.bvh"]
    for line in out:
        assert (tmp_path / line.partition(" ")[2]).read_text().startswith("HIERARCHY")
    assert (tmp_path / "clips" / "manifest.csv").exists()


def test_a_csv_with_mistakes_names_their_lines(elsewhere: Marey, tmp_path: Path) -> None:
    (tmp_path / "prompts.csv").write_text("prompt,seed\na person walks,3\na person waves,minus one\n")
    said = run(elsewhere, tmp_path, "submit_csv.py", "prompts.csv", "clips", code=2)
    assert said == "line 3: seed: is 'minus one', not a whole number\n"


def test_a_job_is_watched_with_its_progress(elsewhere: Marey, tmp_path: Path) -> None:
    out = run(elsewhere, tmp_path, "watch_job.py").splitlines()
    assert out[0] == "would make 4 motions"
    assert "succeeded: 4 of 4" in out
    assert all(line.rstrip().endswith("succeeded") for line in out[-4:])
    assert any(line.startswith("a person bows deeply 8") for line in out)
