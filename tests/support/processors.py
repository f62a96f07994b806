"""Capabilities of this machine's processors, for tests that need them."""

from __future__ import annotations

import pytest
import torch

packs_bfloat16 = pytest.mark.skipif(
    not torch.ops.mkldnn._is_mkldnn_bf16_supported(),
    reason="this processor multiplies no packed bfloat16 matrices (AVX-512); the product uses float32 here",
)
"""Machines without it never pack in bfloat16: `marey.nn.devices.fast_bf16`."""

PACKED_TYPES = [torch.float32, pytest.param(torch.bfloat16, marks=packs_bfloat16)]
"""Types of packed matrices."""

on_a_gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device is available")
"""Beside the mark `gpu`, which chooses such tests."""
