#!/usr/bin/env bash
# Installs a ROS 2 peer (rclpy from wheels) and the interface packages that no wheel brings.
# tests/ros/peer.sh VENV INTERFACE_PACKAGES_BINARY; prints one line why not, and fails, where it
# cannot be had. Afterwards `. VENV/peer.env` and VENV/bin/python speak ROS 2 on this machine alone.
set -euo pipefail
venv=$(realpath -m "$1") binary=$(realpath "$2") here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
why() { echo "$1" && exit 1; }
[ "$(python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')" = 3.11 ] || why "the wheels need Python 3.11"
command -v c++ >/dev/null || why "no C++ compiler"
stamp=$(cat "$here/requirements.txt" "$here/peer.sh" "$here"/../../crates/recording/msg/truck_msgs/msg/*.msg "$binary" | sha256sum)
[ "$(cat "$venv/stamp" 2>/dev/null)" != "$stamp" ] || exit 0
rm -f "$venv/stamp"
python3 -m venv "$venv"
python=$venv/bin/python
"$venv/bin/pip" install -q --disable-pip-version-check -r "$here/requirements.txt" >"$venv/log" 2>&1 ||
  why "pip could not install the wheels: $(grep -m1 ERROR "$venv/log")"
# The wheels' CMake files name the machine that built them.
"$python" - <<'EOF'
import pathlib, sysconfig
import numpy
include = sysconfig.get_path("include")
for file in (pathlib.Path(sysconfig.get_path("data")) / "share").rglob("*.cmake"):
    text = file.read_text(errors="surrogateescape")
    new = text.replace("/opt/python/cp311-cp311/include/python3.11", include).replace(
        "/opt/python/cp311-cp311/lib/python3.11/site-packages/numpy/_core/include", numpy.get_include())
    if new != text:
        file.write_text(new, errors="surrogateescape")
EOF
work=$venv/interfaces prefix=$venv/interfaces/install
rm -rf "$work" && mkdir -p "$work/src"
"$binary" "$work/src"
cp -r "$here/../../crates/recording/msg/truck_msgs" "$work/src/"
export AMENT_PREFIX_PATH=$prefix:$venv CMAKE_PREFIX_PATH=$prefix:$venv LD_LIBRARY_PATH=$prefix/lib:$venv/lib PATH=$venv/bin:$PATH
for package in tf2_msgs can_msgs autoware_control_msgs autoware_vehicle_msgs truck_msgs simulation_interfaces; do
  { cmake -S "$work/src/$package" -B "$work/build/$package" -G Ninja -DCMAKE_INSTALL_PREFIX="$prefix" \
    -DPython3_EXECUTABLE="$python" -DBUILD_TESTING=OFF -DCMAKE_CXX_FLAGS=-O0 -DCMAKE_C_FLAGS=-O0 &&
    nice cmake --build "$work/build/$package" --target install; } >"$venv/log" 2>&1 ||
    why "$package could not be built: $(grep -m1 -i error "$venv/log")"
done
cat >"$venv/peer.env" <<EOF
export AMENT_PREFIX_PATH=$prefix:$venv LD_LIBRARY_PATH=$prefix/lib PYTHONPATH=$prefix/lib/python3.11/site-packages
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
EOF
echo "$stamp" >"$venv/stamp"
