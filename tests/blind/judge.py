"""Holds what the gap workflow named against the sealed answer.

Right is an effect whose kind and gyro are true; where two readings of the data are the same (without a
reference, gyro 1 + e and gyro 2 − e), also the other one, if it says so in `ambiguous_with`. Confidently
wrong is an effect that is not true and does not hold the truth in `ambiguous_with` either; one that was
not applied (`applied` false) is a set without the truth, which is told apart. On clean recordings, decoys
and effects outside the catalogue every name is wrong, but for what is true of the gyros beside what hides
(`benign`) and what another catalogue rightly calls the stranger."""

import math

import strangers

# Drawn at random, a convention, or (of a frozen value) a matter of words by one sample: no truth to meet.
WITHOUT_TRUTH = {"reference_c", "size_dps/spikes", "from_s", "to_s"}
EXACT = {"axis", "from", "harmonic"}
# Statistical names beside the truth fit noise that is there; they are counted, but say nothing about the world.
NOISE = {"white_noise", "rate_random_walk", "gauss_markov", "rate_noise", "bias_instability"}


def _label(effect):
    return effect["kind"], int(effect["gyro"])


def _set(effect):
    return {_label(effect), *(_label(other) for other in effect.get("ambiguous_with", []))}


def _mirrored(found, truth, reference):
    return not reference and found[0] == truth[0] and found[1] != truth[1]


def _same_wave(found, true):
    """Amplitude and phase of a tone in one form: positive amplitude, phase next to the true one."""
    found = dict(found)
    if "phase_rad" in found and "amplitude_dps" in found:
        if found["amplitude_dps"] * true["amplitude_dps"] < 0:
            found["amplitude_dps"] *= -1
            found["phase_rad"] += math.pi
        found["phase_rad"] -= 2 * math.pi * round((found["phase_rad"] - true["phase_rad"]) / (2 * math.pi))
    return found


def parameter_errors(found, true):
    """Name → (error, σ) of each parameter that has a truth; a wrong axis or harmonic is infinitely off."""
    values, sigma, errors = _same_wave(found["parameters"], true["parameters"]), found.get("sigma", {}), {}
    for name, truth in true["parameters"].items():
        if {name, f"{name}/{true['kind']}"} & WITHOUT_TRUTH or name not in values:
            continue
        if name in EXACT:
            if values[name] != truth:
                errors[name] = (math.inf, 1.0)
        elif sigma.get(name):
            errors[name] = (values[name] - truth, sigma[name])
    return errors


def judge(answer, gap, compared=None):
    """Figures of one recording. `gap` is gap.json; `compared` is `compare --json` of the written model on
    the fresh recording."""
    named = gap["effects"]
    truths = (
        []
        if answer["outside"] or answer["group"] in ("clean", "decoy")
        else [_label(e) for e in answer["effects"]]
    )
    benign = {tuple(b) for b in answer.get("benign", [])} - set(truths)
    right = set(truths) | benign
    if answer["outside"]:
        also = strangers.ALSO_RIGHT.get(answer["outside"]["name"], [])
        right |= {(kind, answer["outside"]["gyro"]) for kind in also}
    wrong = [e for e in named if not _set(e) & right]
    right_first = False
    counted = [e for e in named if _label(e) not in benign]
    if counted and len(truths) == 1:
        first = _label(counted[0])
        told = truths[0] in _set(counted[0])
        right_first = first == truths[0] or (_mirrored(first, truths[0], answer["reference"]) and told)
    found = [
        any(_label(e) == t or (_mirrored(_label(e), t, answer["reference"]) and t in _set(e)) for e in named)
        for t in truths
    ]
    errors = []
    for true in answer["effects"] if truths else []:
        matches = [e for e in named if _label(e) == _label(true)]
        if matches:
            errors += [
                [true["kind"], name, *pair] for name, pair in parameter_errors(matches[0], true).items()
            ]
    counts = {label: sum(_label(e) == label for e in named) for label in set(truths)}
    out = {
        "verdict": gap["verdict"],
        "named": [[*_label(e), sorted(map(list, _set(e) - {_label(e)}))] for e in named],
        "truth": [list(t) for t in truths],
        "wrong": [list(_label(e)) for e in wrong],
        "confident": [list(_label(e)) for e in wrong if e.get("applied", True)],
        "unapplied": [list(_label(e)) for e in named if not e.get("applied", True)],
        "deterministic": [list(_label(e)) for e in wrong if e["kind"] not in NOISE],
        "surplus": sum(max(0, n - truths.count(label)) for label, n in counts.items()),
        "right_first": right_first,
        "found": found,
        "covered": [any(t in _set(e) for e in named) for t in truths],
        "errors": errors,
    }
    if compared is not None:
        g = compared["gap"]
        out["fresh_gap"], out["fresh_band"] = g["value"], g["band95"]
        out["closed"] = g["value"] <= g["band95"][1]
    return out


def as_wished(answer, verdict):
    """Nothing to complain of: what hides was named and nothing else."""
    return not verdict["wrong"] and not verdict["surplus"] and all(verdict["found"])
