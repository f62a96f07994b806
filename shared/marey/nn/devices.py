"""Select a device and query its capabilities.

`python -m marey.nn.devices cuda` reports if there is one, for processes that run without torch.
"""

from __future__ import annotations

import os
import sys

import torch

from marey.core.errors import InvalidInput

HINT = "Set MAREY_DEVICE (of a training, --device) to cpu or auto."


def choose_device(name: str) -> torch.device:
    """Return the device of a name: `auto` (CUDA if available), `cpu`, `cuda`, `cuda:1`.

    Raises:
        InvalidInput: the device does not exist.
    """
    if name == "auto":
        local = int(os.environ.get("LOCAL_RANK", "0"))
        found = torch.device("cuda", local) if torch.cuda.is_available() else torch.device("cpu")
        return _without_cudnn_attention(found)
    try:
        device = torch.device(name)
    except RuntimeError as error:
        raise InvalidInput(f"unknown device {name!r}", hint="Use auto, cpu, cuda or cuda:N.") from error
    if device.type == "cuda" and not torch.cuda.is_available():
        raise InvalidInput("no CUDA device is available", where=name, hint=HINT)
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise InvalidInput(f"this machine has {torch.cuda.device_count()} CUDA devices", where=name, hint=HINT)
    return _without_cudnn_attention(device)


def _without_cudnn_attention(device: torch.device) -> torch.device:
    """Keep torch from choosing the attention of cuDNN, whose gradients with masks are wrong on Hopper: measured for
    outputs of which only some rows are used (torch 2.11, cuDNN 9.19), reported for some lengths
    (github.com/pytorch/pytorch/issues/196678). Its other fused kernels agree with the processor."""
    if device.type == "cuda":
        torch.backends.cuda.enable_cudnn_sdp(False)
    return device


def fast_bf16(device: torch.device) -> bool:
    """Return True if bfloat16 matrices are faster than float32: CUDA, and CPUs with AMX or fast AVX-512 instructions.

    Intel's processors with AVX-512 instructions for bfloat16 but without AMX take twice as long as for float32.
    """
    if device.type == "cuda":
        with torch.cuda.device(device):
            return torch.cuda.is_bf16_supported(including_emulation=False)
    found = torch.cpu.get_capabilities()
    by_avx512 = found.get("avx512_bf16", False) and "Intel" not in found.get("cpu_name", "")
    return os.environ.get("MAREY_BF16", "1") != "0" and bool(found.get("amx_bf16", False) or by_avx512)


if __name__ == "__main__":
    try:
        choose_device(sys.argv[1])
    except InvalidInput as error:
        sys.exit(error.message)
