#!/usr/bin/env bash
# The program on the truck for AArch64 Linux under qemu-user: its size, its unit tests, the same bits
# as on this computer, and a drive of the virtual truck whose recording this computer repeats. The
# arguments are the built tests `same_bits` and `two_processes`.
set -euo pipefail
host=$(realpath "${1:?the test binary same_bits}")
drives=$(realpath "${2:?the test binary two_processes}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=aarch64-unknown-linux-gnu
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu"
# the bits do not depend on it; not at all optimised, qemu is too slow for the drive's ticks
export CARGO_PROFILE_RELEASE_OPT_LEVEL=1

log=$(mktemp)
trap 'rm -f "$log" "$log.bin"' EXIT
# with the features that ./test has built the rest with: macros and build scripts are not built again
timeout 900 cargo test --workspace --release --locked \
  --target $target --bin truck-node --test same_bits -- --nocapture >"$log" 2>&1 ||
  { cat "$log"; exit 1; }
grep -E '^(test result|     Running)' "$log"
aarch64-linux-gnu-strip -o "$log.bin" "${CARGO_TARGET_DIR:-target}/$target/release/truck-node"
bytes=$(stat -c %s "$log.bin")
printf 'truck-node for AArch64: %s bytes stripped\n' "$bytes"
[ "$bytes" -lt 10000000 ] || { echo "10,000,000 bytes are the most"; exit 1; }
if diff <("$host" --nocapture | grep '^bits ') <(grep '^bits ' "$log"); then
  echo "the same bits as on this computer"
else
  echo "other bits than on this computer (above: < this one, > AArch64)"
  exit 1
fi
TRUCK_NODE="qemu-aarch64-static -L /usr/aarch64-linux-gnu $(realpath "${CARGO_TARGET_DIR:-target}")/$target/release/truck-node" \
  timeout 180 "$drives" --nocapture drives_and_stops_over_a_server
