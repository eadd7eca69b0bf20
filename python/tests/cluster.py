"""A Ray cluster of two workers on this computer."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

TRIES = 5


@contextlib.contextmanager
def two_workers() -> Iterator[None]:
    """Begins it, and ends it afterwards. Ray gives itself 30 s to begin, too little under load."""
    import ray

    for attempt in range(1, TRIES + 1):
        try:
            ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
            break
        except Exception as slow:
            ray.shutdown()
            if attempt == TRIES or "timed out during startup" not in str(slow):
                raise
    try:
        yield
    finally:
        ray.shutdown()
