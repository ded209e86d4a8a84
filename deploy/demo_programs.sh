# For demo.sh and cluster.sh, which source it: the programs that they build and run. Numbers of running ones are kept in
# $home/*.pid.

build_programs() {
  cmake --preset demo >/dev/null
  cmake --build --preset demo
}

end_programs() {
  local file
  for file in "$home"/*.pid; do
    [ -e "$file" ] || continue
    # After a restart of the machine the number may be another program's.
    case "$(readlink "/proc/$(cat "$file")/exe" 2>/dev/null || true)" in
      "$PWD"/build/demo-build/*) kill "$(cat "$file")" 2>/dev/null || true ;;
    esac
    rm -f "$file"
  done
}

# LCM travels by multicast over the loopback interface.
route_multicast() {
  ip route get 239.255.76.67 >/dev/null 2>&1 && return
  local sudo=()
  [ "$(id -u)" -eq 0 ] || sudo=(sudo)
  "${sudo[@]}" ip link set lo multicast on
  "${sudo[@]}" ip route add 224.0.0.0/4 dev lo
}
