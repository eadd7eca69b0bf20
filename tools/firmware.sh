#!/usr/bin/env bash
# The J1939 stack and the planner on a Cortex-M4 in QEMU (crates/j1939/firmware): checks, what a tick
# costs, and the same bits as on the host. The argument is the built test `same_bits`.
set -euo pipefail
host=$(realpath "${1:?the test binary same_bits}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/firmware
[ "${CARGO_TARGET_DIR#/}" != "$CARGO_TARGET_DIR" ] || CARGO_TARGET_DIR=$PWD/$CARGO_TARGET_DIR
cd crates/j1939/firmware
cargo fmt --check
# the versions of the workspace; cargo leaves out what is not needed here
cp ../../../Cargo.lock Cargo.lock
cargo build -q --release
# shift=0: one nanosecond an instruction, so that a timer counts instructions and every run is alike
timeout 180 qemu-system-arm -M mps2-an386 -cpu cortex-m4 -icount shift=0 -nographic -monitor none \
  -serial none -semihosting-config enable=on,target=native \
  -kernel "$CARGO_TARGET_DIR/thumbv7em-none-eabihf/release/tractrix-firmware" |
  tee "$CARGO_TARGET_DIR/firmware.log"
if diff <("$host" --nocapture | grep '^bits ') <(grep '^bits ' "$CARGO_TARGET_DIR/firmware.log"); then
  echo "the same bits as on the host"
else
  echo "other bits than on the host (above: < host, > Cortex-M4)"
  exit 1
fi
