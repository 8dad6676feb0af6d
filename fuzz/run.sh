#!/usr/bin/env bash
# Fuzzes with libFuzzer and the stable compiler: fuzz/run.sh SECONDS [TARGET...]; all targets one after the other by default.
# Inputs are kept in target/fuzz/corpus, findings in target/fuzz/findings; exit code 1 after a finding.
set -euo pipefail
cd "$(dirname "$0")/.."

if [[ ! ${1:-} =~ ^[1-9][0-9]*$ ]]; then
    echo "usage: fuzz/run.sh SECONDS [TARGET...]" >&2
    exit 2
fi
seconds=$1
shift
targets=("$@")
((${#targets[@]} > 0)) || mapfile -t targets < <(sed -n 's/^name = "\(.*\)"$/\1/p' fuzz/Cargo.toml | tail -n +2)

# What `cargo fuzz` passes: counters at each edge, and the operands of comparisons.
coverage=(-Cpasses=sancov-module)
for option in level=4 inline-8bit-counters pc-table trace-compares; do
    coverage+=("-Cllvm-args=-sanitizer-coverage-$option")
done
host=$(rustc -vV | sed -n 's/^host: //p')
RUSTFLAGS="--cfg fuzzing -Ccodegen-units=1 -Cdebug-assertions -Coverflow-checks ${coverage[*]}" \
    cargo build --release --manifest-path fuzz/Cargo.toml --target "$host" --target-dir target/fuzz

python3 fuzz/seeds.py target/fuzz/corpus
found=0
for target in "${targets[@]}"; do
    findings=target/fuzz/findings/$target/
    mkdir -p "$findings"
    "target/fuzz/$host/release/$target" "target/fuzz/corpus/$target" -max_total_time="$seconds" -max_len=600000 \
        -timeout=60 -rss_limit_mb=3000 -artifact_prefix="$findings" -print_final_stats=1 || found=1
done
exit "$found"
