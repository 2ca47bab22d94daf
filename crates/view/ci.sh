#!/usr/bin/env bash
# Runs the browser tests of the viewer. Usage: crates/view/ci.sh [quick|full]
#   quick  streams, recording sets and exported pages
#   full   also data sets, a live camera and the end of the program
# Installs Chromium (on Debian, as root) and the npm package of the tests.
set -euo pipefail
mode=${1:-quick}
cd "$(dirname "$0")/../.."
. .ci/skip.sh
# Node.js and npm can also come from another source than Debian, so each missing program is installed alone.
for package in chromium nodejs npm; do
    command -v "${package/nodejs/node}" >/dev/null && continue
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        # If the installation fails, the check of the tools below decides.
        apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$package" >/dev/null || true
    fi
done
for tool in chromium node npm; do
    command -v "$tool" >/dev/null || { missing "$tool" "the browser tests of the viewer"; exit 0; }
done
# `--test header` selects the same features of macro crates as `cargo test --workspace`, so cargo compiles nothing twice.
cargo test -q --workspace --no-run --test program --test header
tests=$PWD/crates/view/tests/browser
target=$(realpath "${CARGO_TARGET_DIR:-target}")
# The npm package is outside the sources, because tests of the documentation read every file of the sources.
mkdir -p "$target/browser-tests"
cd "$target/browser-tests"
cp "$tests/package.json" .
[ -d node_modules/playwright-core ] || npm install --silent --no-audit --no-fund --no-package-lock || true
[ -d node_modules/playwright-core ] || { missing playwright-core "the browser tests of the viewer"; exit 0; }
node "$tests/run.mjs" "$target/debug/spikelane" "$mode"
