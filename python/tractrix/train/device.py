"""Where a network is fitted: a device of PyTorch, the same bits from the same seed."""

from __future__ import annotations

import os

import torch


def device_of(name: str) -> torch.device:
    """The device of this name (`cpu`, `cuda`, `cuda:1`), made deterministic; one thread on the CPU.

    Raises:
        ValueError: PyTorch knows no such device, or has none here.
    """
    # cuBLAS reads it when it is first used; without it PyTorch refuses deterministic products.
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError, ImportError) as error:
        first, *_ = str(error).splitlines() or [""]
        raise ValueError(f"device = {name}: not here ({first})") from error
    return device
