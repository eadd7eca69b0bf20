#!/usr/bin/env bash
# Hours of bus time: the logs of tests/data/j1939 mixed and mutated, heard by decoders, transport,
# claim and supervision. No panic, and the memory does not grow.
#   tools/can_soak.sh [BUS_TIME_S] [LIMIT_S]     an hour, ten minutes on the clock at most
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec cargo run -q --release --locked -p tractrix-j1939 --example can_soak -- \
  tests/data/j1939 "${1:-3600}" "${2:-600}"
