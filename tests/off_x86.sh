#!/usr/bin/env bash
# The table of digests where no x86 is: aarch64 under qemu, WebAssembly under node, each with 128-bit vectors. Bits only, no speed.
# What a missing tool cannot run is said: rustup target add, gcc-aarch64-linux-gnu, qemu-user, node 20.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target/off_x86} CARGO_INCREMENTAL=0

has() { rustup target list --installed 2>/dev/null | grep -qx "$1" || { echo "skipped: rustup target add $1"; return 1; }; }
tool() { command -v "$1" >/dev/null || { echo "skipped: no $1"; return 1; }; }
golden() { cargo test -p spikelane --target "$1" --no-default-features --features presets --test golden; }

if has aarch64-unknown-linux-gnu && tool aarch64-linux-gnu-gcc && tool qemu-aarch64; then
    CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
        CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu" \
        golden aarch64-unknown-linux-gnu
fi
if has wasm32-wasip1 && tool node; then
    RUSTFLAGS="-C target-feature=+simd128" CARGO_TARGET_WASM32_WASIP1_RUNNER="node --no-warnings $PWD/tests/wasi.mjs" golden wasm32-wasip1
fi
