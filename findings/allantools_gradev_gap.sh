#!/usr/bin/env bash
# AllanTools 2024.6 (PyPI): gradev(), the deviation for data with gaps, on rates.
#
# Guess: gradev(data, data_type="freq") passes over the samples that are NaN and uses all others, before
# the gap and behind it.
# Behaviour: it sums the rates up to angles first, and a sum that has met a NaN stays NaN. All behind the
# first gap is ignored, be it one sample of a million; the message on stdout only says that phase data is
# preferred. The count that is returned tells it, the deviation does not.
# Seen: noise that is 50 times larger behind one lost sample: 0.30 deg/s, where oadev() of all samples has 14.81.
#
# Needs python3 with venv, and PyPI. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q AllanTools==2024.6 >/dev/null 2>&1

venv/bin/python - 2>said.txt <<'PY' >seen.txt
import allantools
import numpy as np
rates_dps = np.random.default_rng(1).normal(size=10_000) # deg/s, 10 Hz
rates_dps[1_000:] *= 50
whole = allantools.oadev(rates_dps, rate=10.0, data_type="freq", taus=[1.0])
print(f"oadev, no gap: {whole[1][0]:.2f} deg/s from {whole[3][0]:.0f} differences")
rates_dps[1_000] = np.nan
gap = allantools.gradev(rates_dps, rate=10.0, data_type="freq", taus=[1.0])
print(f"gradev, one sample of 10000 lost: {gap[1][0]:.2f} deg/s from {gap[3][0]:.0f} differences")
PY
echo "AllanTools 2024.6: noise of 1 deg/s in samples 0 to 999, of 50 deg/s in 1000 to 9999"
sed 's/^/seen: /' seen.txt

grep -Eq '^oadev, no gap: 1[0-9]\.[0-9]* deg/s from 9981 ' seen.txt || { echo "changed: oadev"; exit 1; }
grep -Eq '^gradev, .*: 0\.[0-9]* deg/s from 9[0-9][0-9] differences' seen.txt || { echo "changed: gradev uses what is behind the gap"; exit 1; }
echo "as described: all behind the first gap is ignored"
