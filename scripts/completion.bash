# Tab completion in an interactive bash; scripts/env.bash sources it.

# Completion of rosrun, roslaunch, rostopic ...: Noetic's setup.bash loads it, Debian's does not.
if ! complete -p roslaunch >/dev/null 2>&1 && [ -r /usr/share/bash-completion/completions/rosbash ]; then
  # shellcheck source=/dev/null
  . /usr/share/bash-completion/completions/rosbash
fi

_drone_mesh_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

_drone_mesh_complete() {
  local words file
  case "${COMP_WORDS[0]##*/} $COMP_CWORD ${COMP_WORDS[1]}" in
    "run "*)
      words=$(sed -n 's/.*<arg name="\([a-z_]*\)".*/\1:=/p' "$_drone_mesh_root/launch/factory.launch")
      words+=" --ros-args --help"
      compopt -o nospace 2>/dev/null  # the value follows; there is nothing to set in a test
      ;;
    "test 1 "*) words="unit lint rostest --help" ;;
    "test "*" rostest")
      for file in "$_drone_mesh_root"/test/rostest/*.test; do
        words+=" test/rostest/${file##*/}"
      done
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}")
}

complete -F _drone_mesh_complete scripts/{run,test} ./scripts/{run,test}
