#!/usr/bin/env bash
# The Python package: built as cargo's tests are, then pytest, stubtest, mypy and ruff in a venv of its own.
# A missing tool is an error, unless ALLOW_SKIP names it.
set -euo pipefail
cd "$(dirname "$0")/../.."

. .ci/skip.sh
skip() {
    missing "$1" "the Python package"
    exit 0
}

# Debian's interpreter sees Debian's torch; PyPI's wheel of it brings CUDA.
python=/usr/bin/python3
[ -x "$python" ] || python=$(command -v python3) || skip python3
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || skip python3.10
venv=target/python
if [ ! -x "$venv/bin/pip" ]; then
    "$python" -m venv --system-site-packages "$venv" || skip python3-venv
fi
"$venv/bin/pip" install -q 'numpy>=1.24' pytest || skip numpy
for tool in mypy ruff tqdm; do
    "$venv/bin/pip" install -q "$tool" || missing "$tool" "a check of the Python package"
done
"$venv/bin/python" -c 'import torch' 2>/dev/null ||
    missing torch "the tests of training (Debian: python3-torch)"

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
