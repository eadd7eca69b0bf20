#!/usr/bin/env bash
# Proves that entry points of j1939 and the guard of the planner need no standard library and no
# allocator, and that no input can make them panic: they are linked with nothing, and with a panic
# handler and an allocator that do not exist. Taken for granted is what every C compiler demands of
# its platform (memcpy and its kin), and the unwinder's entry that tables of Rust's own arithmetic
# name.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/freestanding"

target=${CARGO_TARGET_DIR:-../../target}/freestanding
# the versions of the workspace; cargo leaves out what is not needed here
cp ../../Cargo.lock Cargo.lock
CARGO_TARGET_DIR=$target cargo build -q --release
cc -nostdlib -static -ffreestanding -Wl,--gc-sections -Wl,--undefined=guard_tick \
  -Wl,--defsym=memcpy=0,--defsym=memmove=0,--defsym=memset=0,--defsym=memcmp=0,--defsym=bcmp=0,--defsym=rust_eh_personality=0 \
  -o "$target/freestanding" "$target/release/libfreestanding.a"
printf 'j1939 and the guard link with nothing: %s bytes of code, no way to panic\n' \
  "$(size "$target/freestanding" | awk 'NR == 2 { print $1 }')"
