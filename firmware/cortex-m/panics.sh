#!/bin/sh
# Lists the panics that an image can reach: every call of a panicking function of `core`, with the source lines it was
# inlined from. Needs the binutils for ARM (Debian: binutils-arm-none-eabi).
set -eu
image=${1:?usage: panics.sh IMAGE}
for tool in arm-none-eabi-objdump arm-none-eabi-addr2line; do
    command -v "$tool" >/dev/null || {
        echo "panics.sh: $tool is missing: install binutils-arm-none-eabi" >&2
        exit 2
    }
done
[ -r "$image" ] || {
    echo "panics.sh: $image: cannot be read" >&2
    exit 2
}
code=$(mktemp)
trap 'rm -f "$code"' EXIT
arm-none-eabi-objdump -d --no-show-raw-insn "$image" >"$code" || {
    echo "panics.sh: $image: is no image for ARM" >&2
    exit 2
}
sed -nE 's/^ *([0-9a-f]+):.*\tb[a-z.]*\t[0-9a-f]+ <(.*(panic|unwrap_failed|expect_failed|index_fail|len_mismatch).*)>$/\1 \2/p' "$code" |
    while read -r address callee; do
        echo "$callee"
        arm-none-eabi-addr2line -i -f -C -e "$image" "$address" | paste - - | sed 's/^/    /'
    done
