#!/usr/bin/env bash
# The combinations of features that people take: each has to build without a warning.
set -euo pipefail
cd "$(dirname "$0")/.."
for features in "" presets files files,threads; do
    echo "features: ${features:-none}"
    cargo rustc -q --lib --profile check --no-default-features --features "$features" -- -D warnings
done
echo "features: cli, the program without exr and snee"
cargo clippy -q --bin spikelane --no-default-features --features cli -- -D warnings
echo "what others see: every member without the feature that this crate's own tests turn on"
cargo clippy -q --workspace --lib --bins -- -D warnings
