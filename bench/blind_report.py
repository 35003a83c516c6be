"""The table of bench/blind, in Markdown."""

import collections
import math

Z95 = 1.96


def interval95(hits, count):
    """Wilson's interval of a rate."""
    if count == 0:
        return 0.0, 1.0
    z2, p = Z95**2, hits / count
    whole = 1 + z2 / count
    middle = (p + z2 / (2 * count)) / whole
    half = Z95 * math.sqrt(p * (1 - p) / count + z2 / (4 * count**2)) / whole
    return max(0.0, middle - half), min(1.0, middle + half)


def rate(hits, count):
    if count == 0:
        return "–"
    low, high = interval95(hits, count)
    return f"{hits} of {count} = {100 * hits / count:.0f} % ({100 * low:.0f}–{100 * high:.0f})"


def _strength(answer):
    return "plain" if answer["strength"] is None else f"{answer['strength']:g}"


def _plain_enough(line):
    return line["answer"]["strength"] is None or line["answer"]["strength"] >= 8


def _summary(judged):
    def of(*groups):
        return [line for line in judged if line["answer"]["group"] in groups]

    def wrong(lines):
        return rate(sum(bool(line["judged"]["wrong"]) for line in lines), len(lines))

    singles = [line for line in of("single") if _plain_enough(line)]
    several = [line for line in of("pair", "triple")]
    pairs = of("pair")
    inside = [c for line in singles + several for c in line["judged"]["covered"]]
    errors = [e for line in judged for e in line["judged"]["errors"]]
    hit = sum(abs(e[2]) <= Z95 * e[3] for e in errors)
    fresh = [
        line
        for line in of("single", "pair", "triple")
        if "closed" in line["judged"] and all(line["judged"]["found"])
    ]
    names = [n for line in of("single", "pair", "triple") for n in line["judged"]["named"]]
    wrong_names = sum(len(line["judged"]["wrong"]) for line in of("single", "pair", "triple"))
    first, both = [line["judged"]["right_first"] for line in singles], [
        all(line["judged"]["found"]) for line in pairs
    ]
    closed = [line["judged"]["closed"] for line in fresh]
    rows = [
        ("clean: something named", wrong(of("clean")), "≤ 1 %"),
        (
            "confidently wrong, of recordings with effects of the catalogue",
            wrong(of("single", "pair", "triple")),
            "≤ 1 %",
        ),
        ("the same, of names given", rate(wrong_names, len(names)), ""),
        ("outside the catalogue: something named", wrong(of("outside")), "≤ 5 %"),
        ("decoys: something named", wrong(of("decoy")), ""),
        ("single, \\|t\\| ≥ 8: right name first", rate(sum(first), len(first)), "≥ 95 %"),
        ("pairs: both named rightly", rate(sum(both), len(both)), "≥ 80 %"),
        ("truth among the names or their rivals", rate(sum(inside), len(inside)), "≥ 98 %"),
        ("parameters inside their 95 % interval", rate(hit, len(errors)), "95 %"),
        ("gap of the second recording inside the band, all found", rate(sum(closed), len(closed)), ""),
    ]
    return [
        "| | measured (95 % interval) | wanted |",
        "|---|---|---|",
        *(f"| {a} | {b} | {c} |" for a, b, c in rows),
    ]


NOISE = {"white_noise", "rate_random_walk", "gauss_markov", "rate_noise", "bias_instability"}


def outcome(line):
    """The outcome of a recording in a word."""
    j, group = line["judged"], line["answer"]["group"]
    if j["confident"]:
        return "CONFIDENTLY WRONG" if any(k not in NOISE for k, _ in j["confident"]) else "surplus noise"
    if j["wrong"]:
        return "wrong set"
    if group in ("single", "pair", "triple"):
        if all(j["found"]):
            return "right" if not j["surplus"] else "right, named twice"
        return "in the set" if all(j["covered"]) else "missed"
    if group == "clean" and j["verdict"] != "no_gap":
        return "not called clean"
    return "right"


def inside(line):
    """Is the gap of the held-out samples inside its band?"""
    return line["gap"]["after"] <= line["gap"]["band95"][1]


def one_line(line):
    """One line for a recording: seed, world, hidden, verdict, names, outcome, gap and band, cost."""
    answer = line["answer"]
    hidden = " + ".join(f"{e['kind']} {e['gyro']}" for e in answer["effects"]) or "–"
    if answer["outside"]:
        hidden = f"{answer['outside']['name']} {answer['outside']['gyro']}"
    if answer["group"] in ("decoy", "outside"):
        hidden = f"{answer['group']}: {hidden}"
    t = "/".join(f"{e['t']:g}" for e in answer["effects"] if e.get("t"))
    world = answer.get("world", "bench") + (" ref" if answer["reference"] else "")
    world += " nothing" if answer.get("nothing_given") else ""
    if answer.get("traits"):
        traits = answer["traits"]
        world += f" {traits['pair']} {'x'.join(f'{r:g}' for r in answer['rates_hz'])} {traits['road_dps']:.2g}"
        world += " soft" if traits["soft_noise"] else ""
    front = f"{answer['seed']} | {world} | {hidden}{f' (t {t})' if t else ''} | "
    if "failed" in line:
        return front + "FAILED " + line["failed"]
    g, j = line["gap"], line["judged"]
    sets = {tuple(u) for u in j["unapplied"]}
    names = ", ".join(_named(n) + ("*" if tuple(n[:2]) in sets else "") for n in j["named"]) or "–"
    gap = f"gap {g['before']:.3g} → {g['after']:.3g} [{g['band95'][0]:.3g}, {g['band95'][1]:.3g}]"
    gap += " in" if inside(line) else " OUT"
    return front + f"{j['verdict']} | {names} | {outcome(line)} | {gap} | {line['seconds']:.1f} s, {line['memory_mb']:.0f} MB"


def changes(lines, before):
    """Differences from another build's run of the same recordings: outcome, gap inside its band, seconds."""
    def told(line):
        if "failed" in line:
            return "FAILED", False, math.inf
        return outcome(line), inside(line), line["seconds"]

    old = {line["case"]: told(line) for line in before}
    both = [(line["case"], old[line["case"]], told(line)) for line in lines if line["case"] in old]
    rows = [
        f"| {case} | {was[0]}, {'in' if was[1] else 'OUT'} | {now[0]}, {'in' if now[1] else 'OUT'} |"
        for case, was, now in both
        if was[:2] != now[:2]
    ]
    faster = sorted(was[2] / max(now[2], 1e-3) for _, was, now in both if math.isfinite(was[2]) and math.isfinite(now[2]))
    cost = f", {faster[len(faster) // 2]:.1f} times as fast in the median" if faster else ""
    head = [f"{len(both)} recordings in both, {len(rows)} changed{cost}.", ""]
    return [*head, "| case | before | now |", "|---|---|---|", *rows] if rows else head


def must_reach(lines):
    """The rows with limits, for drives or for all worlds. A run that failed or was ended counts as not right; its
    names are not known, so the rows of wrong names count only the other runs."""
    judged = [line for line in lines if "judged" in line]

    def of(*groups, among=lines):
        return [line for line in among if line["answer"]["group"] in groups]

    def soft(line):
        return line["answer"].get("traits", {}).get("soft_noise", False)

    def good(among, holds):
        return rate(sum("judged" in line and bool(holds(line)) for line in among), len(among))

    def bad(among, holds):
        among = [line for line in among if "judged" in line]
        return rate(sum(bool(holds(line)) for line in among), len(among))

    clean, effects = of("clean"), of("single", "pair", "triple")
    known = [line for line in of("single") if _plain_enough(line)]
    covered = []
    for line in filter(_plain_enough, effects):
        covered += line["judged"]["covered"] if "judged" in line else [False] * len(line["answer"]["effects"])
    closed = lambda line: line["judged"]["verdict"] == "no_gap" and inside(line)
    wrong = lambda line: any(k not in NOISE for k, _ in line["judged"]["confident"])
    noise_only = lambda line: line["judged"]["wrong"] and not line["judged"]["deterministic"]
    sets = lambda line: len(line["judged"]["wrong"]) > len(line["judged"]["confident"])
    late = sum("judged" not in line or line["seconds"] > 10.0 for line in lines)
    rows = [
        ("clean: \"no gap\", inside the band", good([c for c in clean if not soft(c)], closed), "≥ 95 %"),
        ("the same, noise behind the sensor's filter", good([c for c in clean if soft(c)], closed), ""),
        ("single, \\|t\\| ≥ 8: right name first", good(known, lambda l: l["judged"]["right_first"]), "≥ 95 %"),
        ("single, \\|t\\| ≥ 8: held-out gap inside the band", good(known, inside), "≥ 95 %"),
        ("clean: something deterministic named", bad(clean, lambda l: l["judged"]["deterministic"]), "≤ 1 %"),
        ("clean: noise named", bad(clean, noise_only), ""),
        ("confidently wrong, of all", bad(lines, wrong), "≤ 0.5 %"),
        ("the same, of those with effects of the catalogue", bad(effects, wrong), ""),
        ("named without the truth, not applied", bad(lines, sets), ""),
        ("outside the catalogue: something named", bad(of("outside"), lambda l: l["judged"]["wrong"]), "≤ 5 %"),
        ("decoys: something named", bad(of("decoy"), lambda l: l["judged"]["wrong"]), ""),
        ("truth among names and rivals, \\|t\\| ≥ 8", rate(sum(covered), len(covered)), "≥ 99 %"),
        ("failed, or ended by the time limit", rate(len(lines) - len(judged), len(lines)), "0"),
        ("longer than 10 s", rate(late, len(lines)), "0"),
    ]
    times = sorted(line["seconds"] for line in judged) or [0.0]
    memory = max([line["memory_mb"] for line in judged] or [0.0])
    cost = f"median {times[len(times) // 2]:.1f} s, longest {times[-1]:.1f} s, peak {memory:.0f} MB"
    return ["| | measured (95 % interval) | wanted |", "|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in rows),
            "", f"Time and memory of `vgyro gap`, of runs that ended by themselves: {cost}."]  # fmt: skip


def uniformity(judged):
    """For clean recordings: is the p of the best candidate (`null.p_value` of gap.json, if present) below any bound
    as often as the bound says? Kolmogorov and Smirnov's distance, with its 5 % bound."""
    p = sorted(
        line["null_p"] for line in judged if line["answer"]["group"] == "clean" and line.get("null_p") is not None
    )
    if not p:
        return []
    n = len(p)
    distance = max(max((i + 1) / n - v, v - i / n) for i, v in enumerate(p))
    below = ", ".join(f"{rate(sum(v <= b for v in p), n)} below {b:g}" for b in (0.01, 0.05, 0.2, 0.5))
    return [f"p of the best candidate on clean recordings: {below}; distance from uniform {distance:.2f} (5 % bound {1.36 / math.sqrt(n):.2f}).", ""]


FAMILIES = {
    "offsets": ["bias", "bias_step", "bias_ramp", "warm_up", "run_in"],
    "temperature": ["temperature_bias", "temperature_bias_quadratic", "temperature_rate_bias", "temperature_hysteresis"],
    "surroundings": ["g_sensitivity", "vibration_rectification", "supply_voltage_bias"],
    "response to the rate": ["scale_factor", "scale_factor_asymmetry", "scale_factor_quadratic", "scale_factor_cubic",
                             "scale_factor_temperature", "cross_axis"],
    "tones": ["line", "angle_harmonic"],
    "lateness and clocks": ["delay", "bandwidth", "clock_skew", "timestamp_jitter"],
    "noise": sorted(NOISE),
    "clips and frames": ["saturation", "dead_band", "quantization", "spikes", "stuck", "dropped_frames"],
}  # fmt: skip


def coverage(judged):
    """Share of parameters inside their 95 % interval, by family; the median of |error|/σ is 0.67 if σ is right."""
    lines = ["| family | inside 95 % | median of \\|error\\|/σ |", "|---|---|---|"]
    for family, names in FAMILIES.items():
        own = [e for line in judged for e in line["judged"]["errors"] if e[0] in names]
        ratio = sorted(abs(e[2]) / e[3] for e in own)
        hit = sum(r <= Z95 for r in ratio)
        lines.append(f"| {family} | {rate(hit, len(own))} | {f'{ratio[len(ratio) // 2]:.2f}' if own else ''} |")
    return lines


def _power(judged):
    cells, columns = collections.defaultdict(list), []
    for line in judged:
        answer = line["answer"]
        if answer["group"] == "single":
            column = _strength(answer) + ("" if answer["reference"] else ", no reference")
            columns.append(column)
            cells[answer["kind"], column].append(line["judged"])
    order = lambda c: (", no" in c, "plain" in c, float(c.split(",")[0]) if "plain" not in c else 0.0)
    columns = sorted(set(columns), key=order)
    lines = ["| kind | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for kind in dict.fromkeys(k for k, _ in cells):
        text = []
        for column in columns:
            found = cells.get((kind, column), [])
            text.append(f"{sum(j['right_first'] for j in found)}/{len(found)}" if found else "")
        lines.append(f"| `{kind}` | " + " | ".join(text) + " |")
    totals = []
    for column in columns:
        found = [j for (_, c), many in cells.items() if c == column for j in many]
        totals.append(f"**{sum(j['right_first'] for j in found)}/{len(found)}**")
    return [*sorted(lines[2:]), "| all | " + " | ".join(totals) + " |"], lines[:2]


def _named(effect):
    kind, gyro, rivals = effect
    return f"{kind} {gyro}" + (f" (or {'; '.join(f'{k} {g}' for k, g in rivals)})" if rivals else "")


def _confusion(judged):
    lines = []
    for line in judged:
        j, answer = line["judged"], line["answer"]
        if j["wrong"] or j["surplus"]:
            truth = " + ".join(f"{k} {g}" for k, g in j["truth"]) or " ".join(
                [answer["group"], answer["kind"]]
            )
            strength = _strength(answer) + ("" if answer["reference"] else ", no reference")
            lines.append(
                f"| {answer['seed']} | {truth} | {strength} | {', '.join(map(_named, j['named']))} |"
            )
    return ["| seed | hidden | \\|t\\| | named |", "|---|---|---|---|", *lines] if lines else ["None."]


def table(lines, heading):
    judged = [line for line in lines if "judged" in line]
    failed = [line for line in lines if "failed" in line]
    body, head = _power(judged)
    text = [heading, "", *_summary(judged), ""]
    if judged:
        seconds, memory = sorted(line["seconds"] for line in judged), max(
            line["memory_mb"] for line in judged
        )
        times = f"median {seconds[len(seconds) // 2]:.1f} s, longest {seconds[-1]:.1f} s"
        text += [f"Time of `vgyro gap`: {times}; peak memory {memory:.0f} MB.", ""]
        text += ["### What must be reached", "", *must_reach(lines), ""]
        text += uniformity(judged)
        text += ["### Parameters inside their interval", "", *coverage(judged), ""]
    text += ["### Right name first, by kind and |t|", "", *head, *body, ""]
    text += ["### Wrong or surplus names", "", *_confusion(judged), ""]
    if failed:
        text += ["### Runs that failed", "", *(f"- {line['case']}: {line['failed']}" for line in failed), ""]
    return "\n".join(text)
