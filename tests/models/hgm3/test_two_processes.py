"""Training by two processes (torchrun, gloo)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from safetensors.torch import load_file

from tests.support.prepared import write_prepared

ROOT = Path(__file__).parents[3]
WEIGHTS = Path("tokenizer/part/weights.safetensors")


@pytest.mark.slow
def test_two_processes_train_every_stage_and_resume_exactly(tmp_path: Path) -> None:
    write_prepared(tmp_path / "prepared")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "-m",
               "tests.support.two_processes", str(tmp_path)]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    whole, resumed = (
        load_file(tmp_path / run / "tokenizer" / "part" / "weights.safetensors") for run in ("run", "again")
    )
    assert all((whole[name] == resumed[name]).all() for name in whole)
    assert {path.parent.parent.name for path in (tmp_path / "run").glob("*/part/part.json")} == {
        "tokenizer", "masked", "residual", "length",
    }  # fmt: skip
