#!/usr/bin/env bash
# Checks that the common combinations of features compile without a warning. Usage: .ci/features.sh [quick|full]
#   quick  the kernel library (default)
#   full   also the benchmarks and the program
set -euo pipefail
cd "$(dirname "$0")/.."
for features in "" threads presets maps threads,presets; do
    echo "spikelane, features: ${features:-none}"
    cargo clippy -q -p spikelane --lib --no-default-features --features "$features" -- -D warnings
done
[ "${1:-quick}" = full ] || exit 0
echo "spikelane-benchmark, without ssimulacra2"
cargo clippy -q -p spikelane-benchmark --no-default-features --all-targets -- -D warnings
echo "the program without exr, snee and ssimulacra2"
cargo clippy -q -p spikelane-cli --no-default-features -- -D warnings
