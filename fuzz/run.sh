#!/bin/sh
# Fuzzes one reader or all of them in turn, one process, on stable Rust.
#
#   fuzz/run.sh 60                 a minute each
#   fuzz/run.sh 60 csv             a minute of one
#   RUNS=1000000 fuzz/run.sh 0 csv a million executions
#
# Findings go to fuzz/artifacts, new inputs to fuzz/work (neither is committed);
# `fuzz/run.sh 0 csv fuzz/artifacts/csv/crash-...` runs one input again.
set -eu
cd "$(dirname "$0")"
seconds=${1:?seconds per target, or 0 with RUNS=...}
targets=${2:-csv toml obj glb}
shift $(($# < 2 ? $# : 2))

# What cargo-fuzz would pass, less the sanitizers that need a nightly compiler:
# counters on every edge and traced comparisons for libFuzzer.
host=$(rustc -vV | sed -n 's/^host: //p')
export RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Ccodegen-units=1"
cargo build --release --quiet --target "$host" --bins

for target in $targets; do
    program=target/$host/release/$target
    if [ $# -gt 0 ]; then
        "$program" "$@"
        continue
    fi
    mkdir -p "work/$target" "artifacts/$target"
    echo "== $target"
    "$program" "work/$target" "corpus/$target" -dict="words/$target.dict" -max_len=4096 -timeout=10 \
        -rss_limit_mb=2048 -artifact_prefix="artifacts/$target/" -max_total_time="$seconds" -runs="${RUNS:--1}" \
        -print_final_stats=1 2>"work/$target.log" || { tail -40 "work/$target.log"; exit 1; }
    grep -E "DONE|stat::number_of_executed_units|stat::peak_rss_mb" "work/$target.log"
done
