"""Heavy highway trucks in closed loop, in every traffic mode and engine of Tractrix.

    with tractrix.World("dense-15", seed=3) as world:
        world.step(1000)
        print(world.ego.speed_m_s, world.scene()["front_s_m"])

Units are in the names. Axes are those of ISO 8855: x forward, y left, z up, yaw counter-clockwise.
Road frame: s along the route, d to the left of its reference line. The ego's reference point is the
centre of the tractor's drive-axle group, on the ground.
"""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from tractrix import drives
from tractrix._diagnosis import diagnose
from tractrix._fleet import diagnose_many
from tractrix._native import GIT_REVISION as __git_revision__
from tractrix._native import VERSION as __version__
from tractrix._native import Snapshot
from tractrix._plan import plan
from tractrix._policy import Policy
from tractrix._recording import read_run
from tractrix._rerun import rerun_blueprint
from tractrix._scenario import scenario, scenarios
from tractrix._state import SCENE_DTYPE, Decision, Ego
from tractrix._truck_model import TruckModel
from tractrix._world import World

if TYPE_CHECKING:
    from tractrix._client import Client, Refused
    from tractrix._vector_env import VectorEnv

__all__ = [
    "SCENE_DTYPE",
    "Client",
    "Decision",
    "Ego",
    "Policy",
    "Refused",
    "Snapshot",
    "TruckModel",
    "VectorEnv",
    "World",
    "__git_revision__",
    "__version__",
    "diagnose",
    "diagnose_many",
    "drives",
    "plan",
    "read_run",
    "rerun_blueprint",
    "scenario",
    "scenarios",
]

if find_spec("gymnasium") is not None:
    import gymnasium

    gymnasium.register(
        id="tractrix/Highway-v0",
        entry_point="tractrix._gym:HighwayEnv",
        vector_entry_point="tractrix._vector_env:VectorEnv",
    )


def __getattr__(name: str) -> Any:
    """What needs another package is there as soon as it is asked for: `VectorEnv` (`tractrix[gym]`),
    `Client` and its `Refused` (`tractrix[client]`)."""
    if name in ("Client", "Refused"):
        from tractrix import _client

        return getattr(_client, name)
    if name == "VectorEnv":
        from tractrix._vector_env import VectorEnv

        return VectorEnv
    raise AttributeError(f"module 'tractrix' has no attribute {name!r}")
