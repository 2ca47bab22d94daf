#!/usr/bin/env bash
# The Python package: built as cargo's tests are, then pytest, stubtest, mypy and ruff in a venv of its own.
# A tool that cannot be installed is said, and what needs it is skipped.
set -euo pipefail
cd "$(dirname "$0")/../.."

skip() {
    echo "bindings/python: skipped: $*"
    exit 0
}

# Debian's interpreter sees Debian's torch; PyPI's wheel of it brings CUDA.
python=/usr/bin/python3
[ -x "$python" ] || python=$(command -v python3) || skip "no python3"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || skip "$python is older than 3.10"
venv=target/python
if [ ! -x "$venv/bin/pip" ]; then
    "$python" -m venv --system-site-packages "$venv" || skip "no venv: install python3-venv"
fi
"$venv/bin/pip" install -q 'numpy>=1.24' pytest || skip "numpy or pytest could not be installed"
for tool in mypy ruff tqdm; do
    "$venv/bin/pip" install -q "$tool" || echo "bindings/python: without $tool, which could not be installed"
done
"$venv/bin/python" -c 'import torch' 2>/dev/null ||
    echo "bindings/python: without torch: apt-get install python3-torch; its tests are skipped"

# Not by maturin, which would compile most crates a second time: with a bench beside it, and so with what tests need, and
# with the one test that reads Rust, the module shares every crate with `cargo test --workspace`: macros that are a program's
# crates too are compiled in another way. Its users' wheel is `pip install .`.
PYO3_BUILD_EXTENSION_MODULE=1 cargo build -q --workspace --lib --bin spikelane --bench plan --test header
package=bindings/python/python
case "$(uname)" in
Darwin) cp target/debug/lib_native.dylib "$package/spikelane/_native.abi3.so" ;;
*) cp target/debug/lib_native.so "$package/spikelane/_native.abi3.so" ;;
esac

export PYTHONPATH="$PWD/$package" SPIKELANE="$PWD/target/debug/spikelane"
SPIKELANE_TRAIN_SECONDS=${SPIKELANE_TRAIN_SECONDS:-5} "$venv/bin/python" -m pytest -q -rs bindings/python/tests
if [ -x "$venv/bin/mypy" ]; then
    "$venv/bin/mypy" --config-file pyproject.toml
fi
if [ -x "$venv/bin/ruff" ]; then
    "$venv/bin/ruff" check bindings/python
    "$venv/bin/ruff" format --check bindings/python
fi
