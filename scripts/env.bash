# Makes drone_mesh known to rosrun, roslaunch, rostopic, rosservice and Python in this terminal:
#
#     source scripts/env.bash

drone_mesh_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [ -e "$drone_mesh_root/build/devel/setup.bash" ]; then
  # shellcheck source=/dev/null
  . "$drone_mesh_root/build/devel/setup.bash"
  case ":$PATH:" in
    *":$drone_mesh_root/.venv/bin:"*) ;;
    *) PATH="$drone_mesh_root/.venv/bin:$PATH" ;;
  esac
  case "$drone_mesh_root" in
    *[[:space:]]*) # see scripts/prepare.bash
      drone_mesh_packages=("$drone_mesh_root"/.venv/lib/python3*/site-packages)
      export PYTHONPATH="${drone_mesh_packages[0]}${PYTHONPATH:+:$PYTHONPATH}"
      unset drone_mesh_packages
      ;;
  esac
  export PYTHONUNBUFFERED=1  # log lines appear at once, also in a pipe
  # ROS gives the name of this machine to other nodes, which must be able to resolve it.
  if [ -z "$ROS_HOSTNAME$ROS_IP" ] && ! getent hosts "$(uname -n)" >/dev/null; then
    export ROS_HOSTNAME=localhost
  fi
  if [[ $- == *i* && -n $BASH_VERSION ]]; then
    # shellcheck source=scripts/completion.bash
    . "$drone_mesh_root/scripts/completion.bash"
  fi
  unset drone_mesh_root
else
  unset drone_mesh_root
  echo "drone_mesh is not built yet: run scripts/run or scripts/test once" >&2
  return 1
fi
