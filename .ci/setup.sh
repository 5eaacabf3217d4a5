#!/usr/bin/env bash
# Makes the virtual environment .venv with everything that building, testing and linting need.
# Called by make; does nothing when the environment is as it should be.
#
# Where a ROS 2 is sourced, the environment sees that installation's packages (its own Python,
# --system-site-packages) and pip adds only what is missing.  Elsewhere ROS 2 Jazzy comes from PyPI.
#
# PYTHON=/path/to/python overrides the choice of the interpreter.
# VENV names another directory, and CONSTRAINTS a file of versions for pip, as for make test-lowest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# The ROS wheels of another environment leave this in the variables of their processes; with it
# those of .venv would not find their libraries.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE

venv=${VENV:-.venv}
constraints=${CONSTRAINTS:-}
stamp=$venv/.set-up
ros_wheels=(ros-jazzy-rclpy ros-jazzy-common-interfaces ros-jazzy-rmw-fastrtps-cpp ros-jazzy-test-msgs)
tools=(colcon-common-extensions mypy ruff setuptools)

fail() {
    echo "setup: $*" >&2
    exit 1
}

# The interpreter behind $1: follows pyenv's shims and virtual environments; fails where none runs.
behind() {
    "$1" -c 'import sys; print(sys._base_executable)' 2>/dev/null
}

# Whether interpreter $1 has version $2 (3.11, say) or a later one.
at_least() {
    "$1" -c 'import sys; sys.exit(sys.version_info[:2] < tuple(map(int, sys.argv[1].split("."))))' "$2"
}

# Whether interpreter $1 can make environments and compile extensions: pyeda has no wheels.
complete() {
    "$1" -c '
import ensurepip, pathlib, sys, sysconfig, venv
sys.exit(not (pathlib.Path(sysconfig.get_path("include")) / "Python.h").is_file())' 2>/dev/null
}

sourced_ros_python() {
    local python
    [[ -n ${ROS_DISTRO:-}${AMENT_PREFIX_PATH:-} ]] || return 1
    python=$(behind "${PYTHON:-python3}") || return 1
    "$python" -c 'import rclpy' >/dev/null 2>&1 || return 1
    echo "$python"
}

choose_python() {
    local candidate python
    for candidate in ${PYTHON:-python3 python3.12 python3.13 python3.11}; do
        python=$(behind "$candidate") || continue
        # There are ROS wheels for 3.10 to 3.13, and rebt_ros needs 3.11.
        if at_least "$python" 3.11 && ! at_least "$python" 3.14 && complete "$python"; then
            echo "$python"
            return
        fi
    done
    fail "${PYTHON:-this machine} has no Python 3.11, 3.12 or 3.13 with its venv module and headers" \
        "(on Debian and Ubuntu: apt install python3-venv python3-dev); another can be named with" \
        "'make setup PYTHON=/path/to/python'"
}

if ros_python=$(sourced_ros_python); then
    ros=sourced
    at_least "$ros_python" 3.11 ||
        fail "rebt_ros needs Python 3.11 or newer, and the ROS 2 that is sourced uses $ros_python"
else
    ros=wheels
fi

wanted=$(echo "ros=$ros ${ros_python:-} python=${PYTHON:-any}" && sha256sum setup.py .ci/setup.sh $constraints)
if $venv/bin/python -c '' 2>/dev/null && [[ -f $stamp && $(<$stamp) == "$wanted" ]]; then
    exit 0
fi

# Whether .venv runs, has the kind of ROS, and the interpreter asked for, if any.
usable() {
    local asked=${ros_python:-${PYTHON:-}} sees_system=false
    [[ $ros == sourced ]] && sees_system=true
    grep -qs "^include-system-site-packages = $sees_system" $venv/pyvenv.cfg || return 1
    [[ -z $asked || $(behind $venv/bin/python) == "$(behind "$asked")" ]] || return 1
    $venv/bin/python -m pip --version >/dev/null 2>&1
}

if ! usable; then
    python=${ros_python:-$(choose_python)}
    options=(--clear)
    if [[ $ros == sourced ]]; then options+=(--system-site-packages); fi
    echo "setup: making $venv with $python"
    "$python" -m venv "${options[@]}" $venv ||
        fail "could not make $venv (on Debian and Ubuntu: apt install python3-venv)"
fi
rm -f $stamp

# What else is on Python's path, such as another workspace, would count as installed in .venv; of a
# ROS 2 that is sourced, it does.
own_path=()
if [[ $ros == wheels ]]; then own_path=(env -u PYTHONPATH); fi

pip_install() {
    # Quiet down to errors: pip's progress and warnings would bury what comes after.
    "${own_path[@]}" $venv/bin/python -m pip install -qq --no-input --disable-pip-version-check \
        ${constraints:+-c "$constraints"} "$@" ||
        fail "pip could not install $*"
}

if [[ $ros == sourced ]]; then
    echo "setup: installing what the sourced ROS 2 ${ROS_DISTRO:-} does not have"
    pip_install "${tools[@]}"
else
    echo "setup: installing ROS 2 Jazzy and the tools from PyPI, once; this takes a minute or two"
    pip_install "${tools[@]}" "${ros_wheels[@]}"
fi

# The package itself is installed by colcon; only its dependencies go into the environment.
# Where versions are given, two extras are left out: a cluster needs a newer joblib than the rest, and
# the tasks of the driving benchmark are no part of the package.
mapfile -t dependencies < <(CONSTRAINTS=$constraints $venv/bin/python -c '
import os, setuptools, distutils.core
package = distutils.core.run_setup("setup.py", stop_after="init")
left_out = {"cluster", "driving"} if os.environ["CONSTRAINTS"] else set()
extras = [needs for extra, needs in package.extras_require.items() if extra not in left_out]
print(*package.install_requires, *sum(extras, []), sep="\n")')
[[ ${#dependencies[@]} -gt 0 ]] || fail "could not read the dependencies out of setup.py"
if ! command -v cc >/dev/null && ! $venv/bin/python -c 'import pyeda' 2>/dev/null; then
    fail "pyeda is compiled when it is installed and needs a C compiler: install gcc"
fi
pip_install "${dependencies[@]}"

echo "$wanted" >$stamp
