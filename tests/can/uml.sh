#!/usr/bin/env bash
# Runs test binaries in User-Mode Linux, whose kernel has CAN sockets, vcan and can-j1939.
#   tests/can/uml.sh LIMIT_S COMMAND [ARG...]
#   tests/can/uml.sh check        only says whether it can run here
# The host's file system is the root there, /tmp and /run are in memory. The exit code is that of the
# command: it is printed inside and read here, for User-Mode Linux does not pass it on.
# Exit code 77: it cannot run here, the reason is printed.
set -uo pipefail
limit_s=${1:?LIMIT_S COMMAND...}
shift
have() { command -v "$1" >/dev/null 2>&1; }
for tool in linux.uml j1939cat busybox insmod; do
  have $tool || { echo "no $tool (apt: user-mode-linux can-utils busybox-static kmod)"; exit 77; }
done
modules=$(echo /usr/lib/uml/modules/*/kernel)
[ -f "$modules/net/can/j1939/can-j1939.ko" ] || { echo "no can-j1939 for User-Mode Linux"; exit 77; }
if [ "$limit_s" = check ]; then
  # On a processor with AMX a thread's registers (11 kB) are more than its kernel has room for, and it
  # ends before its first program; whatever else is wrong is for the tests to find.
  if said=$("$0" 20 true) || [[ $said != *"ptrace set fp regs failed"* ]]; then exit 0; fi
  echo "User-Mode Linux cannot hold the registers of this processor (AMX)"
  exit 77
fi

work=$(mktemp -d)
uml=
# a kernel that hangs is killed with its threads; nobody else's
stop() {
  [ -n "$uml" ] && kill -KILL -- "-$uml" 2>/dev/null
  rm -rf "$work"
}
trap stop EXIT
cat >"$work/init" <<INIT
#!/bin/bash
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp RUST_BACKTRACE=0
mount -t proc proc /proc; mount -t sysfs sysfs /sys
mount -t tmpfs tmpfs /run; mount -t tmpfs tmpfs /mnt
for m in drivers/net/can/dev/can-dev net/can/can net/can/can-raw drivers/net/can/vcan net/can/j1939/can-j1939; do
  insmod $modules/\$m.ko || echo "insmod \$m failed"
done
busybox ip link set lo up
for i in 0 1 2; do busybox ip link add dev vcan\$i type vcan; done
busybox ip link set vcan1 mtu 72
busybox ip link set vcan0 up; busybox ip link set vcan1 up
export TMPDIR=/run
cd $(printf %q "$PWD")
timeout -k 5 $limit_s $(printf '%q ' "$@")
echo "RC=\$?"
busybox poweroff -f
INIT
chmod +x "$work/init"

set -m # a process group of its own, and this script kills no other
timeout -k 5 $((limit_s + 60)) linux.uml root=none rootfstype=hostfs rootflags=/ ro mem=384M \
  init="$work/init" con0=fd:0,fd:1 con=null quiet panic=-1 </dev/null >"$work/log" 2>&1 &
uml=$!
wait "$uml"
tr -d '\r' <"$work/log" | sed 's/\x1b\[[0-9;]*m//g'
code=$(tr -d '\r' <"$work/log" | sed -n 's/^RC=\([0-9]*\)$/\1/p' | tail -n 1)
[ -n "$code" ] || { echo "User-Mode Linux ended without a result"; exit 1; }
exit "$code"
