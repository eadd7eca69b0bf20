#!/usr/bin/env bash
# In place of rustc for the crates of the workspace (RUSTC_WORKSPACE_WRAPPER): compiles one, and runs
# clippy's lints and rustdoc over it, strictly. `cargo clippy` and `cargo doc` would check 400
# dependencies anew, only to know of them what the build knows already. What is optimised are the
# libraries: most tests' own words are not what takes time. A bench is checked and not compiled.
set -euo pipefail
rustc=$1
shift
all=" $* "
# cargo also asks what the compiler is
[[ $all == *" --emit="* && $all != *" --crate-name ___ "* ]] || exec "$rustc" "$@"
compiled=yes linted=apart documented=no options=(-D warnings)
case $all in
*/benches/*.rs\ *) compiled=no ;;
# tests that compute themselves, or have a tick of real time to do it in
*/diagnosis/tests/* | */j1939/tests/* | */planner/tests/* | */truck-node/tests/* | \
  */diagnosis/src/lib.rs*" --test "* | */traffic-client/src/lib.rs*" --test "* | */bus_loop.rs\ * | */can_soak.rs\ *) optimised=1 ;;
*" --test "* | */examples/*.rs\ *) optimised=0 ;;
*" --crate-name build_script_"*) ;;
# all of rustdds for each message: six times as long to compile, and nobody waits for its messages here
*" --crate-name ros2 "*) documented=yes options+=(-C opt-level=0) ;;
*) documented=yes ;;
esac
# Clippy is a compiler that leaves out some optimisation: what is delivered needs it, and of the tests
# those of traffic. What has unit tests is read by clippy with them, unless more is allowed there.
[ -z "${optimised:-}" ] || [[ $all == *" --crate-name traffic_client "* ]] || linted=compiled
[ $documented = no ] || [[ $all =~ " --crate-name "(diagnosis|tractrix_tests)" " ]] || linted=no
options+=(${optimised:+-C opt-level=$optimised})
[ $linted != compiled ] || exec clippy-driver rustc "$@" "${options[@]}"
[ $compiled = no ] || "$rustc" "$@" "${options[@]}"
[ $linted = apart ] || [ $documented = yes ] || exit 0

into=$(mktemp -d)
trap 'rm -rf "$into"' EXIT
arguments=(--out-dir "$into" -D warnings)
while [ $# -gt 0 ]; do
  case $1 in
  --emit=*) ;;
  --out-dir) shift ;;
  # else cargo would take what is made here for what it waits for
  --json=*) arguments+=("${1/,artifacts/}") ;;
  *) arguments+=("$1") ;;
  esac
  shift
done
[ $linted = no ] || clippy-driver rustc "${arguments[@]}" --emit=metadata
[ $documented = yes ] || exit 0
[[ $all == *" --crate-type bin "* ]] && arguments+=(--document-private-items)
rustdoc "${arguments[@]}" -A rustdoc::private-intra-doc-links
