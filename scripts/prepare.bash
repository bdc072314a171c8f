# Sourced by the other scripts: installs what is missing and builds. Apart from system packages,
# nothing outside the checkout changes.
# shellcheck disable=SC2034  # some variables are for the scripts that source this

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv="$root/.venv"
python=/usr/bin/python3
javascript="$venv/javascript"
noetic=/opt/ros/noetic/setup.bash
pip_options=()
simulation_requirements=(requirements/{console,http,mqtt,report,simulation}.txt)

if [ -e "$noetic" ]; then
  ros_packages=(
    cmake g++ make python3-setuptools
    ros-noetic-{actionlib,actionlib-msgs,catkin,diagnostic-msgs,diagnostic-updater,geometry-msgs}
    ros-noetic-{message-generation,message-runtime,rosbag}
    ros-noetic-{rosbash,rosgraph-msgs,roslaunch,rosmsg,rosnode,rosparam,rospy,rosservice,rostest}
    ros-noetic-{rostopic,std-msgs,tf2-msgs,visualization-msgs}
  )
  screen_packages=(iproute2 libgl1 mosquitto tshark xvfb)
  browsers=()  # Ubuntu has Chromium as a snap only
  rviz_package=ros-noetic-rviz
else
  ros_packages=(
    catkin cmake g++ make python3-setuptools
    ros-core ros-message-generation ros-message-runtime rosbash
    libactionlib-msgs-dev libdiagnostic-msgs-dev libgeometry-msgs-dev libros-rosgraph-msgs-dev librostest-dev
    libstd-msgs-dev libtf2-msgs-dev libvisualization-msgs-dev
    ros-{actionlib,diagnostic,geometry,rosgraph,std,tf2,visualization}-msgs
    python3-{actionlib,diagnostic,geometry,tf2,visualization}-msgs
    python3-actionlib python3-diagnostic-updater
    python3-rospy python3-rostest
  )
  screen_packages=(iproute2 libgl1 mosquitto tshark xvfb)
  browsers=(chromium-headless-shell)  # takes half of the processor time of the whole Chromium
  rviz_package=rviz
fi

say() { printf '== %s\n' "$*"; }
fail() { printf 'scripts/%s: %s\n' "${0##*/}" "$*" >&2; exit 1; }

# apt_install PACKAGE...: installs those that are missing, as root or through sudo.
apt_install() {
  local package missing=() as_root=() apt
  for package in "$@"; do
    dpkg-query -W -f '${Status}\n' "$package" 2>/dev/null | grep -q 'ok installed' ||
      missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return
  command -v apt-get >/dev/null || fail "apt-get not found; install these packages yourself: ${missing[*]}"
  if [ "$(id -u)" -ne 0 ]; then
    as_root=(sudo)
    if ! command -v sudo >/dev/null || { [ ! -t 0 ] && ! sudo -n true 2>/dev/null; }; then
      fail "not root, and sudo is not available; ask for: apt-get install --no-install-recommends ${missing[*]}"
    fi
  fi
  say "installing ${#missing[@]} system packages and their dependencies: ${missing[*]}"
  apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive
    apt-get -q -y -o DPkg::Lock::Timeout=600 -o Dpkg::Use-Pty=0)
  "${apt[@]}" update </dev/null || fail "apt-get update failed; check the network"
  "${apt[@]}" install --no-install-recommends "${missing[@]}" </dev/null ||
    fail "apt-get could not install: ${missing[*]}"
}

# use_python PYTHON: for what needs no ROS, another interpreter with a virtual environment of its own.
use_python() {
  python=$(command -v "$1") || fail "no such Python: $1"
  venv="$root/.venv-$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')" || exit
}

# make_venv: by default with the system's Python, the one that can import ROS.
make_venv() {
  "$venv/bin/python" -m pip --version >/dev/null 2>&1 && return
  "$python" -c 'import ensurepip, venv' 2>/dev/null || apt_install python3 python3-venv
  say "making the virtual environment ${venv##*/}"
  "$python" -m venv --clear --system-site-packages "$venv" || fail "could not make $venv"
}

# pip_install [OPTION...] FILE...: installs requirement files whose content has changed.
pip_install() {
  local options=() file changed=()
  while [[ $1 == --* ]]; do options+=("$1"); shift; done
  for file in "$@"; do
    cmp -s "$root/$file" "$venv/.installed-$(basename "$file")" || changed+=("$file")
  done
  [ ${#changed[@]} -eq 0 ] && return
  say "installing Python packages into ${venv##*/}: ${changed[*]}"
  # All at once: each start of pip looks at all that is installed.
  (cd "$root" && "$venv/bin/python" -m pip install --disable-pip-version-check --no-input \
    --prefer-binary --progress-bar off "${pip_options[@]}" "${options[@]}" "${changed[@]/#/-r}" </dev/null) ||
    fail "pip could not install ${changed[*]}"
  for file in "${changed[@]}"; do cp "$root/$file" "$venv/.installed-$(basename "$file")"; done
}

# can_check_javascript: eslint needs Node.js 18; Ubuntu 20.04 has 10.
can_check_javascript() { node -e 'process.exit(parseInt(process.versions.node) < 18 ? 1 : 0)'; }

# npm_install: the checks of the page's JavaScript, unless these very versions are installed.
npm_install() {
  cmp -s "$root/scripts/javascript/package-lock.json" "$javascript/.installed" && return
  command -v npm >/dev/null || apt_install nodejs npm
  can_check_javascript || return 0
  say "installing npm packages into .venv: scripts/javascript"
  rm -rf "$javascript"
  cp -r "$root/scripts/javascript" "$javascript"
  (cd "$javascript" && npm ci --no-audit --no-fund </dev/null) || fail "npm could not install them"
  cp "$javascript/package-lock.json" "$javascript/.installed"
}

# map_library: Leaflet, which draws the tiles of a map, beside the web console. It is no part of this
# project, so git ignores it; `setup.py` takes it along.
map_library() {
  local from="$root/scripts/javascript" to="$root/src/drone_mesh/console/leaflet" at
  cmp -s "$from/package-lock.json" "$to/.installed" && return
  command -v npm >/dev/null || apt_install nodejs npm
  say "installing Leaflet from npm"
  at=$(mktemp -d)
  cp "$from"/package{,-lock}.json "$at"
  (cd "$at" && npm ci --omit=dev --no-audit --no-fund </dev/null) || fail "npm could not install it"
  rm -rf "$to"
  mkdir "$to"
  cp "$at"/node_modules/leaflet/{LICENSE,dist/leaflet-src.esm.js,dist/leaflet.css} "$to"
  cp "$from/package-lock.json" "$to/.installed"
  rm -rf "$at"
}

# build_step WHAT COMMAND...: logs the output; prints the end of it on failure.
build_step() {
  local log="$root/build/build.log"
  say "$1 in build/"
  "${@:2}" >"$log" 2>&1 || { tail -n 30 "$log" >&2; fail "$1 failed; see build/build.log"; }
}

# build: plain CMake, which rebuilds only what has changed.
build() {
  # shellcheck disable=SC1090
  [ -e "$noetic" ] && . "$noetic"
  # Python is all that runs here. In a catkin workspace messages are made for each language.
  export ROS_LANG_DISABLE=${ROS_LANG_DISABLE-gencpp:geneus:genlisp:gennodejs}
  if ! grep -qsxF "CMAKE_HOME_DIRECTORY:INTERNAL=$root" "$root/build/CMakeCache.txt"; then
    # Nothing is built, or the checkout has been moved: CMake stores absolute paths. Not ours.
    find "$root/build" -mindepth 1 -maxdepth 1 ! -name .lock ! -name compiled -exec rm -rf {} +
  fi
  # catkin writes this into the first lines of scripts, which cannot name a path with a space.
  local python="$venv/bin/python"
  [[ $python != *[[:space:]]* ]] || python=/usr/bin/python3 # finds .venv with scripts/env.bash
  # Debian 13's catkin asks for the second name.
  [ -e "$root/build/Makefile" ] ||
    build_step configuring cmake -S "$root" -B "$root/build" \
      -DPYTHON_EXECUTABLE="$python" -DPython_EXECUTABLE="$python" -DCMAKE_INSTALL_PREFIX="$root/build/install"
  build_step building cmake --build "$root/build" -j "$(nproc)"
}

# alone COMMAND...: waits until no other script installs or builds in this checkout.
alone() {
  mkdir -p "$root/build"
  (
    flock -n 9 || { say "waiting for another build in this checkout"; flock 9; }
    "$@" 9>&-
  ) 9>"$root/build/.lock" || exit
}

# prepare_physics: pybullet has no wheel for Python 3.12 and newer. pip builds it once and keeps the
# wheel in its cache, so that the next checkout has it at once. It must not see numpy while it builds:
# gcc 14 refuses what it does with it, and only isolated builds are sure not to.
prepare_physics() {
  "$venv/bin/python" -c 'import importlib.util as i; exit(i.find_spec("pybullet") is None)' && return
  apt_install g++ python3-dev
  say "pip builds pybullet from its source, unless it has done so before: some four minutes on two cores"
  pip_install --use-pep517 requirements/physics.txt
}

# quick_roslaunch: roslaunch loads distutils, in whose place setuptools would load the whole of itself:
# more than half of the start of roslaunch and rostest. Only where Python still has its own.
quick_roslaunch() {
  ! "$python" -S -c 'import distutils.spawn' 2>/dev/null || export SETUPTOOLS_USE_DISTUTILS=stdlib
}

can_compile() { "$venv/bin/python" -c 'import sys; exit(sys.version_info < (3, 10))'; }

# prepare_mypyc: a mypy that compiles, in a folder of its own, because .venv has one for Python 3.8.
prepare_mypyc() {
  local at="$root/build/compiled/mypyc"
  cmp -s "$root/requirements/compile.txt" "$at/.installed" && return
  say "installing mypyc into build/compiled"
  "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --progress-bar off --upgrade \
    "${pip_options[@]}" --target "$at" -r "$root/requirements/compile.txt" </dev/null || fail "pip could not install mypyc"
  cp "$root/requirements/compile.txt" "$at/.installed"
}

# prepare_compiler: what compiles the core.
prepare_compiler() {
  make_venv
  pip_install requirements/base.txt
  can_compile || fail "mypyc needs Python 3.10"
  local headers
  headers=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_paths()["include"])') || exit
  if [ ! -e "$headers/Python.h" ] || ! command -v cc >/dev/null; then apt_install g++ python3-dev; fi
  prepare_mypyc
}

# compiler ARGUMENTS...: Python with mypyc, so that setup.py compiles.
compiler() { DRONE_MESH_COMPILE=yes PYTHONPATH="$root/build/compiled/mypyc" "$venv/bin/python" "$@"; }

# compile_core: the mesh's hot path, into a folder whose name fits the sources.
compile_core() {
  local builds=build/compiled folder
  prepare_compiler
  exec 9>"$builds/.lock"  # beside installations and other builds, but not beside another of these
  flock 9
  folder=$(DRONE_MESH_CORE=python PYTHONPATH=src "$venv/bin/python" -c 'from drone_mesh.compiled import build; print(build())') || exit
  say "compiling into ${folder#"$root/"}"
  rm -rf "$builds"/{new,old,temp}
  compiler setup.py -q build_ext --build-lib "$builds/new" --build-temp "$builds/temp" >"$builds/log" 2>&1 ||
    { tail -n 30 "$builds/log" >&2; fail "mypyc failed; see $builds/log"; }
  [ ! -d "$folder" ] || mv "$folder" "$builds/old"
  mv "$builds/new" "$folder"
  # Programs that run now still load from the latest ones.
  find "$builds" -maxdepth 1 -name '????????????????' -mtime +1 ! -path "$folder" -exec rm -rf {} +
  rm -rf "$builds"/{old,temp}
}

prepare_simulation() {
  apt_install "${ros_packages[@]}"
  make_venv
  pip_install "${simulation_requirements[@]}"
  build
}

prepare_lab() {
  make_venv
  pip_install requirements/report.txt requirements/lab.txt
}

prepare_unit_tests() {
  make_venv
  pip_install "${simulation_requirements[@]}" requirements/{lab,test}.txt
  prepare_physics
  pip_install --no-deps requirements/test-bare.txt
}

prepare_checks() {
  prepare_unit_tests
  "$venv/bin/python" "$root/scripts/message_stubs"
  pip_install requirements/checks.txt
  ! can_compile || prepare_mypyc
  npm_install
}

# What the checks and rostests need beside the unit tests.
prepare_rest() {
  prepare_checks
  pip_install requirements/{browser,docs}.txt
}
