#!/usr/bin/env bash
# Runs every baseline on suites, and writes the tables into a page. On suites of reconstruction, the script also runs the
# learned method and the methods of Spike-Zoo, if Python has their packages.
# Usage: studies/src/baselines/main.sh FOLDER SUITE...
# Environment: SPIKELANE (program), PYTHON (interpreter), PAGE (default: docs/why/benchmark.md), THREADS (default: 2).
set -euo pipefail
folder=$1
shift
spikelane=${SPIKELANE:-spikelane} python=${PYTHON:-python3} page=${PAGE:-docs/why/benchmark.md}
examples=bindings/python/examples
for suite in "$@"; do
    data=$folder/$suite runs=$folder/$suite.runs
    mkdir -p "$runs"
    if [ ! -e "$data/suite.json" ]; then
        TIMEFORMAT="$suite: generated in %R s, processor time %U s"
        time "$spikelane" benchmark generate "$suite" -o "$data" --threads "${THREADS:-2}" --resume
        du -sb "$data"
    fi
    case $suite in
    color) methods=(tfp-bilinear tfp-malvar tfp-menon span-bilinear span-malvar span-menon) ;;
    flow) methods=(trivial block-matching) ;;
    depth | detection | tracking) methods=(trivial) ;;
    *)
        methods=(tfp tfp-blur tfi tfi-blur span span-blur)
        "$python" -c 'import numpy' 2>/dev/null && methods+=(learned)
        "$python" -c 'import spikezoo' >/dev/null 2>&1 && methods+=(spikezoo-tfp spikezoo-tfi)
        ;;
    esac
    scores=() labels=()
    for method in "${methods[@]}"; do
        case $method in
        learned) options=(--server "$python $examples/learned_method.py") ;;
        spikezoo-*) options=(--server "$python $examples/spikezoo_method.py ${method#spikezoo-}") ;;
        *) options=(--baseline "$method") ;;
        esac
        [ -e "$runs/$method/score.json" ] ||
            "$spikelane" benchmark run "$data" -o "$runs/$method" --resume "${options[@]}"
        scores+=("$runs/$method/score.json") labels+=(--label "$method")
    done
    "$spikelane" benchmark report "${scores[@]}" "${labels[@]}" -o "$runs/report" --force --markdown "$page"
done
