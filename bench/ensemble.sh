#!/usr/bin/env bash
# Everything that docs/ensembles.md says of a GPU: tests on it, times over the size of a batch, choices, the sweeps.
#
#   bench/ensemble.sh FOLDER [DEVICE]      # writes its results there
set -uo pipefail
out=${1:?usage: bench/ensemble.sh FOLDER [DEVICE]}
device=${2:-cuda:0}
python=${PYTHON:-python3}
export PYTHONUNBUFFERED=1
mkdir -p "$out"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
status=0
run() {
  echo "== $*"
  "$@" 2>&1 || { echo "== ended with $?"; status=1; }
}
{
  if "$python" -c "import pytest" 2>/dev/null; then
    run "$python" -m pytest -x -q -m gpu tests/ensemble/test_stepping.py tests/kernels/test_batched.py
  fi
  run "$python" -m warpbrain.bench ensemble --device "$device" --sweep single --json "$out/batches_double.json"
  run "$python" -m warpbrain.bench ensemble --device "$device" --precision single --batches 64,256,512 \
    --json "$out/batches_single.json"
  run "$python" bench/batch_choices.py "$device"
  run "$python" -m warpbrain ensemble --case synthetic --grid --device "$device" --out "$scratch/sweep"
  cp "$scratch/sweep/summary.json" "$out/sweep.json"
  cp "$scratch/sweep/samples.csv" "$out/sweep.csv"
  exit "$status"
} | tee "$out/log.txt"
