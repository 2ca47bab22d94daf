#!/usr/bin/env bash
# Installs the programs that `.ci/run` needs in addition to Rust. Installs only on Debian and as root. For a program that is
# still missing, the step that needs the program prints an error.
set -euo pipefail
packages=(build-essential cmake pkg-config python3-venv strace valgrind)
[ "${1:-}" != full ] || packages+=(gcc-aarch64-linux-gnu gcc-mingw-w64-x86-64 libc6-dev-arm64-cross nodejs qemu-user wine64)
absent=()
for package in "${packages[@]}"; do
    dpkg -s "$package" >/dev/null 2>&1 || absent+=("$package")
done
[ ${#absent[@]} -gt 0 ] || exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "${absent[@]}" >/dev/null && exit 0
fi
echo "not installed: ${absent[*]}" >&2
