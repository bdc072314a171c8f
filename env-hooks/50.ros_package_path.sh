# shellcheck shell=sh
# By ROS_PACKAGE_PATH rosrun, roslaunch and rospkg find packages. Nothing in Debian 13 sets it.
# A devel space names the folders of its sources, an install space none.
read -r drone_mesh_sources <"$CATKIN_ENV_HOOK_WORKSPACE/.catkin" || true
drone_mesh_sources=$(printf %s "${drone_mesh_sources:-$CATKIN_ENV_HOOK_WORKSPACE/share}" | tr ';' ':')
case ":$ROS_PACKAGE_PATH:" in
  *":$drone_mesh_sources:"*) ;;
  *) export ROS_PACKAGE_PATH="$drone_mesh_sources:${ROS_PACKAGE_PATH:-/usr/share}" ;;
esac
unset drone_mesh_sources
