#!/bin/sh
# Names who can still panic in an image: every call of a panicking function of `core`, with the lines it was inlined
# from. Needs the binutils for ARM (Debian: binutils-arm-none-eabi).
set -eu
image=${1:?usage: panics.sh IMAGE}
arm-none-eabi-objdump -d --no-show-raw-insn "$image" |
    sed -nE 's/^ *([0-9a-f]+):.*\tb[a-z.]*\t[0-9a-f]+ <(.*(panic|unwrap_failed|expect_failed|index_fail|len_mismatch).*)>$/\1 \2/p' |
    while read -r address callee; do
        echo "$callee"
        arm-none-eabi-addr2line -i -f -C -e "$image" "$address" | paste - - | sed 's/^/    /'
    done
