"""Compares the names of the gap workflow with the sealed answer.

An effect is right if its kind and gyro are true. If the data have two equal explanations (without a
reference, gyro 1 + e and gyro 2 − e), the other one is right too, provided that `ambiguous_with` contains
the truth. An effect is confidently wrong if it is not true and `ambiguous_with` does not contain the
truth either; one that was not applied (`applied` false) is a set without the truth, and is counted
separately. On clean recordings, decoys and effects outside the catalogue every name is wrong, except true
properties of the gyros beside the hidden effects (`benign`) and the names that a later catalogue rightly
gives a stranger."""

import math

import strangers

# Parameters without a truth: drawn at random, a convention, or (for a frozen value) ambiguous by one sample.
WITHOUT_TRUTH = {"reference_c", "size_dps/spikes", "from_s", "to_s"}
EXACT = {"axis", "from", "harmonic"}
# Additional statistical names fit noise that is present; they are counted, but are no statement about the
# world.
NOISE = {"white_noise", "rate_random_walk", "gauss_markov", "rate_noise", "bias_instability"}


def _label(effect):
    return effect["kind"], int(effect["gyro"])


def _set(effect):
    return {_label(effect), *(_label(other) for other in effect.get("ambiguous_with", []))}


def _mirrored(found, truth, reference):
    return not reference and found[0] == truth[0] and found[1] != truth[1]


def _same_wave(found, true):
    """Amplitude and phase of a tone in a common form: positive amplitude, phase nearest to the true one."""
    found = dict(found)
    if "phase_rad" in found and "amplitude_dps" in found:
        if found["amplitude_dps"] * true["amplitude_dps"] < 0:
            found["amplitude_dps"] *= -1
            found["phase_rad"] += math.pi
        found["phase_rad"] -= 2 * math.pi * round((found["phase_rad"] - true["phase_rad"]) / (2 * math.pi))
    return found


def parameter_errors(found, true):
    """Name → (error, σ) of each parameter that has a truth; the error of a wrong axis or harmonic is
    infinite."""
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
    """Is the result as wished: the hidden effects are named and nothing else?"""
    return not verdict["wrong"] and not verdict["surplus"] and all(verdict["found"])
