#!/usr/bin/env bash
# Tries the packages of package.sh as a new user does, and fails with the first step that does not work:
#   amd64   installed with apt into a Debian root; check; run against the simulated autopilot; the ground-station kit; the
#           report of a flight; removed
#   arm64   unpacked, and checked under user-mode emulation
#   static  checked in a folder that holds nothing else
# usage: firmware/companion/package_test.sh [amd64|arm64|static]...      without a name: amd64
#
# Needs root and Debian's debootstrap; for arm64 also qemu-user and libc6-dev-arm64-cross. The first run makes the
# Debian root (about a minute) and keeps it in target/package.
set -euo pipefail
cd "$(dirname "$0")/../.."
repository=$PWD
out=$repository/target/package
work=$(mktemp -d)
serving=
cleanup() {
    [[ -z $serving ]] || kill "$serving" 2>/dev/null || true
    rm -rf "$work"
}
trap cleanup EXIT

fail() {
    echo "package_test.sh: $1" >&2
    exit 1
}

# The one package of this architecture.
package() {
    local found
    found=$(compgen -G "$out/gleaner_*_$1.deb") || fail "no package for $1: run firmware/companion/package.sh $1"
    [[ $(wc -l <<<"$found") == 1 ]] || fail "several packages for $1: remove the old ones from $out"
    echo "$found"
}

# Without a network the ports of the example configuration are free.
alone() {
    unshare --net -- "$@"
}

debian_root() {
    local release=bookworm archive=$out/debian-root.tar
    if ! [[ -f $archive ]]; then
        command -v debootstrap >/dev/null || fail "debootstrap is missing: apt install debootstrap"
        debootstrap --variant=minbase "$release" "$work/new" >"$work/debootstrap.log" ||
            fail "debootstrap: $(tail -n 1 "$work/debootstrap.log")"
        tar -C "$work/new" -cf "$archive.part" .
        mv "$archive.part" "$archive"
        rm -rf "$work/new"
    fi
    mkdir "$work/root"
    tar -C "$work/root" -xf "$archive"
}

try_amd64() {
    local deb root=$work/root log=$work/run.log
    deb=$(package amd64)
    debian_root
    cp "$deb" "$root/tmp/gleaner.deb"
    chroot "$root" apt-get install -y --no-install-recommends /tmp/gleaner.deb >"$work/apt.log" 2>&1 ||
        fail "apt install: $(tail -n 3 "$work/apt.log")"
    for file in usr/bin/gleaner etc/gleaner/{gleaner.toml,mission.toml,city.csv} usr/share/gleaner/models/gleaner.onnx \
        usr/share/gleaner/ground-station/{gleaner.MavlinkActions.json,mavproxy_gleaner.py} \
        usr/share/gleaner/routers/{mavlink-router.conf,mavlink-server.sh} \
        usr/share/gleaner/examples/pytorch_policy.py; do
        [[ -f $root/$file ]] || fail "the package has no /$file"
    done
    compgen -G "$root/*/lib/systemd/system/gleaner.service" >/dev/null ||
        compgen -G "$root/lib/systemd/system/gleaner.service" >/dev/null || fail "the package has no unit"

    alone chroot "$root" gleaner check --config /etc/gleaner/gleaner.toml --wait 0 ||
        fail "gleaner check does not pass with the files of the package"
    try_run "$root" "$log"

    echo '# edited' >>"$root/etc/gleaner/gleaner.toml"
    mkdir -p "$root/var/log/gleaner"
    echo '{}' >"$root/var/log/gleaner/decisions.jsonl"
    chroot "$root" apt-get remove -y gleaner >"$work/apt.log" 2>&1 || fail "apt remove: $(tail -n 3 "$work/apt.log")"
    [[ ! -e $root/usr/bin/gleaner ]] || fail "the program is still there after its removal"
    grep -q '# edited' "$root/etc/gleaner/gleaner.toml" || fail "the removal took the configuration"
    [[ -f $root/var/log/gleaner/decisions.jsonl ]] || fail "the removal took the logs"
    echo "amd64: installed, checked, run${tried_kit:+ with a ground station}, removed"
}

# The installed program serves the simulated autopilot of the build.
try_run() {
    local root=$1 log=$2 sitl=$repository/target/release/gleaner-sitl port station running
    [[ -x $sitl ]] || fail "gleaner-sitl is not built: cargo build --release"
    : >"$work/serve.log"
    : >"$log"
    "$sitl" serve --companion tcpin:127.0.0.1:0 --radio udpout:127.0.0.1:9 --gcs udpin:127.0.0.1:0 \
        --out "$work/flight" >"$work/serve.log" 2>&1 &
    serving=$!
    for ((second = 0; second < 20; second++)); do
        port=$(sed -n 's/^companion.*:\([0-9]\{2,\}\).*/\1/p' "$work/serve.log" | head -n 1)
        [[ -z $port ]] || break
        sleep 1
    done
    [[ -n $port ]] || fail "gleaner-sitl serve does not say its port: $(head -n 5 "$work/serve.log")"
    station=$(sed -n 's/^gcs.*:\([0-9]\{2,\}\).*/\1/p' "$work/serve.log" | head -n 1)
    timeout 180 chroot "$root" gleaner run --config /etc/gleaner/gleaner.toml --autopilot "tcpout:127.0.0.1:$port" \
        --radio udpin:127.0.0.1:0 --log /tmp/log --state /tmp/state >"$log" 2>&1 &
    running=$!
    for ((second = 0; second < 15; second++)); do
        ! grep -q "serving ArduPilot" "$log" || break
        sleep 1
    done
    try_kit "$root" "$station"
    kill -TERM "$running"
    wait "$running" || true
    kill "$serving"
    serving=
    grep -q "serving ArduPilot on a quadrotor" "$log" || fail "gleaner run serves no autopilot: $(tail -n 5 "$log")"
    # What a ground station set is kept.
    if [[ -n $tried_kit ]]; then
        grep -q "GLN_W_DATA = 0.125" "$root/tmp/state/parameters.toml" || fail "the preference was not kept"
    fi
    # A flight becomes a page, without any other file.
    "$sitl" fly --seed 3 --out "$root/tmp/flown" >"$work/fly.log" || fail "gleaner-sitl fly: $(tail -n 3 "$work/fly.log")"
    chroot "$root" gleaner report /tmp/flown --html /tmp/flight.html || fail "a flight does not become a page"
}

# Every button of the QGroundControl file and every command of the MAVProxy module, as installed. The Python programs are
# those of the tests.
tried_kit=
try_kit() {
    local root=$1 station=$2 python=$repository/target/venv/bin/python
    if ! [[ -x $python ]]; then
        echo "package_test.sh: the ground-station kit is not tried: cargo test makes target/venv" >&2
        return
    fi
    "$python" "$repository/tests/python/kit_station.py" "udpout:127.0.0.1:$station" \
        "$root/usr/share/gleaner/ground-station" >"$work/kit.log" 2>&1 || fail "kit: $(tail -n 3 "$work/kit.log")"
    tried_kit=yes
}

try_arm64() {
    command -v qemu-aarch64 >/dev/null || fail "qemu-aarch64 is missing: apt install qemu-user"
    dpkg-deb -x "$(package arm64)" "$work/arm64"
    alone qemu-aarch64 -L /usr/aarch64-linux-gnu "$work/arm64/usr/bin/gleaner" \
        check --config "$work/arm64/etc/gleaner/gleaner.toml" --wait 0 || fail "gleaner check does not pass on arm64"
    echo "arm64: unpacked and checked under emulation"
}

try_static() {
    [[ -f $out/gleaner-amd64-static ]] || fail "no static binary: run firmware/companion/package.sh amd64"
    mkdir -p "$work/static"
    cp "$out/gleaner-amd64-static" "$work/static/gleaner"
    cp firmware/companion/dist/{gleaner.toml,mission.toml,city.csv} "$work/static/"
    alone chroot "$work/static" /gleaner check --config /gleaner.toml --wait 0 ||
        fail "the static binary does not pass its check"
    echo "static: checked in an empty folder"
}

((EUID == 0)) || fail "a Debian root needs root: run it with sudo"
(($# > 0)) || set -- amd64
for what; do
    case $what in
        amd64 | arm64 | static) "try_$what" ;;
        *) fail "$what is not packaged: name amd64, arm64 or static" ;;
    esac
done
