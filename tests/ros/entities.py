"""Asks for the states of all entities at once, and prints how many there are, as one JSON line."""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any

import rclpy
from simulation_interfaces.srv import GetEntities, GetEntitiesStates

ANSWER_S = 20.0


def main() -> int:
    rclpy.init(domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    node = rclpy.create_node("asker")

    def ask(kind: Any, name: str) -> Any:
        client = node.create_client(kind, name)
        assert client.wait_for_service(ANSWER_S), name
        # The server may not know the client yet
        time.sleep(1.0)
        answer = client.call_async(kind.Request())
        rclpy.spin_until_future_complete(node, answer, timeout_sec=ANSWER_S)
        assert answer.done(), name
        return answer.result()

    names = ask(GetEntities, "/get_entities")
    states = ask(GetEntitiesStates, "/get_entities_states")
    found = {
        "entities": len(names.entities),
        "states": len(states.states),
        "named": len(states.entities),
        "words": states.result.error_message,
    }
    print(json.dumps(found))
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
