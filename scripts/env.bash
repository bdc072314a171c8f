# For each terminal in which rosrun, roslaunch, rostopic, rosservice or Python shall know drone_mesh:
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
  export PYTHONUNBUFFERED=1  # a node's log lines come at once, into a pipe too
  # ROS tells other nodes the name of this machine; one that cannot be looked up helps nobody.
  if [ -z "$ROS_HOSTNAME$ROS_IP" ] && ! getent hosts "$(uname -n)" >/dev/null; then
    export ROS_HOSTNAME=localhost
  fi
  unset drone_mesh_root
else
  unset drone_mesh_root
  echo "drone_mesh is not built yet: start scripts/run or scripts/test once" >&2
  return 1
fi
