#!/usr/bin/env bash
# Tests the Python package: compiles the module, and runs pytest, stubtest, mypy and ruff in a separate virtual environment.
# A missing tool is an error, unless ALLOW_SKIP, a comma-separated list, names the tool.
set -euo pipefail
cd "$(dirname "$0")/../.."

. .ci/skip.sh
skip() {
    missing "$1" "the Python package"
    exit 0
}

# The interpreter of Debian finds Debian's torch package. The torch wheel of PyPI would also install CUDA.
python=/usr/bin/python3
[ -x "$python" ] || python=$(command -v python3) || skip python3
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || skip python3.10
venv=target/python
if [ ! -x "$venv/bin/pip" ]; then
    # PyTorch before 2.3, such as that of Debian 12, does not work with NumPy 2, which other packages need.
    site=()
    "$python" -c 'import sys, torch; sys.exit(tuple(map(int, torch.__version__.split(".")[:2])) < (2, 3))' 2>/dev/null &&
        site=(--system-site-packages)
    "$python" -m venv "${site[@]}" "$venv" || skip python3-venv
fi
"$venv/bin/pip" install -q 'numpy>=1.24' pytest || skip numpy
for tool in mypy ruff tqdm webdataset datasets pillow pycocotools; do
    "$venv/bin/pip" install -q "$tool" || missing "$tool" "a check of the Python package"
done
"$venv/bin/python" -c 'import torch' 2>/dev/null ||
    missing torch "the tests of training (PyTorch 2.3 or later)"

# maturin would compile most crates again. `--bench plan --test header` select the same dependencies and features, also of macro
# crates, as `cargo test --workspace`. So cargo reuses every compiled crate. Users install the package with `pip install .`.
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
