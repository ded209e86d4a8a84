# For demo.sh and cluster.sh, which source it: steps, builds and the programs that run. Process ids are in $home/*.pid,
# output of builds in $home/*.log.

# step TEXT: prints the text with the minutes and seconds since the script began.
step() { printf '[%d:%02d] %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

# run_logged LOG COMMAND...: runs a command with its output in LOG; where it fails, prints the end of LOG and ends.
run_logged() {
  local log=$1
  shift
  "$@" >"$log" 2>&1 || { tail -n 30 "$log" >&2; echo "Failed: $*. All output is in $log" >&2; exit 1; }
}

# Reads ninja's output and prints the steps done and a linear estimate of the time left: on a terminal in one line, else a
# line every 30 s.
show_progress() {
  local line text began=$SECONDS next=0 left
  while IFS= read -r line; do
    [[ $line =~ ^\[([0-9]+)/([0-9]+)\] ]] || continue
    local count=${BASH_REMATCH[1]} total=${BASH_REMATCH[2]} elapsed=$((SECONDS - began))
    text="$count of $total steps"
    if ((elapsed >= 20)); then
      left=$((elapsed * (total - count) / count))
      if ((left >= 90)); then text+=", about $(((left + 30) / 60)) minutes left"; else text+=", about a minute left"; fi
    fi
    if [ -t 1 ]; then
      printf '\r\e[K       %s' "$text"
    elif ((elapsed >= next)); then
      echo "       $text"
      next=$((elapsed + 30))
    fi
  done
  [ ! -t 1 ] || printf '\r\e[K'
}

# build PRESET: builds the targets of a build preset of the demo.
build() {
  local log="$home/$1-build.log"
  run_logged "$log" cmake --preset demo
  if ! NINJA_STATUS='[%f/%t] ' cmake --build --preset "$1" 2>&1 | tee -a "$log" | show_progress; then
    sed -n '/^FAILED/,$p' "$log" | head -n 40 >&2
    echo "The build failed. All output is in $log" >&2
    return 1
  fi
}

end_programs() {
  local file pid
  for file in "$home"/*.pid; do
    [ -e "$file" ] || continue
    pid="$(cat "$file")"
    # Another program may have the id after a restart of the machine: joulecast's programs in this folder are the demo's.
    case "$(readlink "/proc/$pid/cwd" 2>/dev/null || true):$(readlink "/proc/$pid/exe" 2>/dev/null || true)" in
      "$PWD":*/joulecast*) kill "$pid" 2>/dev/null || true ;;
    esac
    rm -f "$file"
  done
}

# LCM uses multicast over the loopback interface.
route_multicast() {
  ip route get 239.255.76.67 >/dev/null 2>&1 && return
  local sudo=()
  [ "$(id -u)" -eq 0 ] || sudo=(sudo)
  "${sudo[@]}" ip link set lo multicast on
  "${sudo[@]}" ip route add 224.0.0.0/4 dev lo
}
