#!/usr/bin/env bash
# Fuzzes each target for a while: run.sh [SECONDS each, default 60]. Needs a nightly toolchain and cargo-fuzz.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
if ! cargo +nightly fuzz --version > /dev/null 2>&1; then
    echo "cargo-fuzz or a nightly toolchain is missing: cargo install cargo-fuzz" >&2
    exit 1
fi
mkdir -p fuzz/corpus/readers
cp -n tests/data/*.msh tests/data/*.mtx examples/data/*.mesh fuzz/corpus/readers/ 2> /dev/null || true
for target in readers mcp friction; do
    cargo +nightly fuzz run --sanitizer none "$target" -- -max_total_time="$seconds" -timeout=30 -rss_limit_mb=2048
done
