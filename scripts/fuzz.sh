#!/bin/sh
# Runs fuzz targets without cargo-fuzz and on a stable compiler: scripts/fuzz.sh 'TARGET ...' SECONDS [libFuzzer's options]
# What is found lies in fuzz/artifacts/TARGET. With cargo-fuzz there is a sanitizer as well; we have no unsafe code of ours for it.
set -eu
targets=$1
seconds=$2
shift 2
cd "$(dirname "$0")/../fuzz"
host=$(rustc -vV | sed -n 's/^host: //p')
# A target of its own, so that build scripts and macros are not instrumented.
build="--release --target $host --target-dir target/coverage"
# Seeds without coverage, which needs a fuzzer to link with.
cargo run --quiet --example seeds
RUSTFLAGS="--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1"
export RUSTFLAGS
bins=
for target in $targets; do
    bins="$bins --bin $target"
done
# shellcheck disable=SC2086
cargo build $build $bins
for target in $targets; do
    mkdir -p "corpus/$target" "artifacts/$target"
    "target/coverage/$host/release/$target" "corpus/$target" -artifact_prefix="artifacts/$target/" \
        -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -max_len=65536 "$@"
done
