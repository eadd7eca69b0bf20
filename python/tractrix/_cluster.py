"""Work on a Ray cluster: functions of their arguments alone, begun again where a worker dies.

Without `ray.init` before it, Ray joins the cluster that `RAY_ADDRESS` names, or begins one on this
computer. Every computer of a cluster needs the package.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

ATTEMPTS = 3
"""How often work is begun whose worker dies."""


def ray_module() -> Any:
    """Ray.

    Raises:
        ImportError: It is not installed.
    """
    try:
        import ray
    except ImportError as missing:
        hint = 'a cluster is used with: pip install "tractrix[scale]"'
        raise ImportError(hint) from missing
    return ray


def each(
    work: Callable[..., Any],
    arguments: Sequence[tuple[Any, ...]],
    *,
    at_once: int | None = None,
    cpus: int = 1,
    lost: Callable[..., Any] | None = None,
) -> list[Any]:
    """What `work` makes of each of the arguments, in their order.

    Args:
        work: A function whose result hangs on its arguments alone.
        arguments: Arguments of each call.
        at_once: How many calls are given to the cluster at a time. Default: all.
        cpus: Processors that a call takes.
        lost: Called with the arguments and the error of a call whose worker died `ATTEMPTS` times;
            what it returns is the result. Default: the error is raised.

    Raises:
        ImportError: Ray is not installed.
    """
    ray = ray_module()
    remote = ray.remote(max_retries=ATTEMPTS - 1, num_cpus=cpus)(work)
    calls: list[Any] = []
    waiting: list[Any] = []
    for given in arguments:
        if at_once is not None and len(waiting) >= at_once:
            _, waiting = ray.wait(waiting)
        calls.append(remote.remote(*given))
        waiting.append(calls[-1])
    results = []
    for call, given in zip(calls, arguments, strict=True):
        try:
            results.append(ray.get(call))
        except ray.exceptions.WorkerCrashedError as died:
            if lost is None:
                raise
            results.append(lost(*given, died))
    return results
