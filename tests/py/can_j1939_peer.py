"""A node on a bus with can-j1939: claims address 0x90, asks 0x80 for its vehicle identification,
answers requests for its own component identification, sends back what is sent to it, sends trouble
codes every second. What it sees goes to standard output, a line each; it ends with its input."""

import argparse
import sys
import threading

import can
import j1939

OURS = 0x90
THEIRS = 0x80
VI = 65260
CI = 65259
PROPRIETARY_A = 61184
CI_TEXT = b"PYTHON*J1939*2.0.12*"
CODES = [(100, 1, 3), (524000, 31, 126), (110, 0, 1)]

said = threading.Lock()


def say(text: str) -> None:
    with said:
        print(text, flush=True)


class Node:
    def __init__(self, arguments: argparse.Namespace) -> None:
        # a window of one packet, the default, would not exercise windows
        self.ecu = j1939.ElectronicControlUnit(max_cmdt_packets=16)
        place = (
            {"host": arguments.host, "port": arguments.port} if arguments.host else {}
        )
        self.ecu.connect(
            interface=arguments.interface, channel=arguments.channel, **place
        )
        name = j1939.Name(
            arbitrary_address_capable=0,
            industry_group=0,
            vehicle_system_instance=0,
            vehicle_system=0,
            function=1,
            function_instance=0,
            ecu_instance=0,
            manufacturer_code=666,
            identity_number=1234567,
        )
        self.ca = j1939.ControllerApplication(name, OURS)
        self.ecu.add_ca(controller_application=self.ca)
        # after add_ca: before it there is nothing to subscribe to
        self.ca.subscribe(self.on_message)
        self.ca.subscribe_request(self.on_request)
        self.dm1 = j1939.Dm1(self.ca)
        self.dm1.subscribe(self.on_codes)
        self.has_vi = False
        self.has_codes = False
        self.is_claimed = False
        self.ca.add_timer(0.2, self.on_timer)
        self.dm1.start_send(self.codes)
        self.ca.start()

    def on_timer(self, _cookie: object) -> bool:
        if self.ca.state == j1939.ControllerApplication.State.NORMAL:
            if not self.is_claimed:
                self.is_claimed = True
                say(f"claimed {self.ca.device_address}")
            if not self.has_vi:
                self.ca.send_request(0, VI, THEIRS)
        return True

    def on_message(
        self, _priority: int, pgn: int, sa: int, _timestamp: float, data: bytearray
    ) -> None:
        if sa != THEIRS:
            return
        if pgn == VI and not self.has_vi:
            self.has_vi = True
            say(f"vi {bytes(data).decode()}")
        if pgn & 0xFF00 == PROPRIETARY_A:
            say(f"bytes {len(data)}")
            self.ca.send_pgn(0, PROPRIETARY_A >> 8, THEIRS, 6, list(data))

    def on_request(self, _source: int, _destination: int, pgn: int) -> None:
        if pgn == CI:
            self.ca.send_pgn(0, CI >> 8, CI & 0xFF, 6, list(CI_TEXT))

    def on_codes(
        self, sa: int, _lamps: object, codes: list[dict[str, int]], _timestamp: float
    ) -> None:
        if sa == THEIRS and not self.has_codes:
            self.has_codes = True
            say("dm1 " + " ".join(f"{c['spn']}/{c['fmi']}/{c['oc']}" for c in codes))

    def codes(self) -> tuple[dict[str, int], list[dict[str, int]]]:
        return {}, [{"spn": spn, "fmi": fmi, "oc": oc} for spn, fmi, oc in CODES]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("interface", choices=["socketcand", "socketcan"])
    parser.add_argument("channel")
    parser.add_argument("--host")
    parser.add_argument("--port", type=int)
    node = Node(parser.parse_args())
    sys.stdin.read()
    node.ecu.disconnect()


if __name__ == "__main__":
    try:
        main()
    except can.CanError as error:
        sys.exit(f"can_j1939_peer.py: {error}")
