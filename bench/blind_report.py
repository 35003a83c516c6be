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
    text += ["### Right name first, by kind and |t|", "", *head, *body, ""]
    text += ["### Wrong or surplus names", "", *_confusion(judged), ""]
    if failed:
        text += ["### Runs that failed", "", *(f"- {line['case']}: {line['failed']}" for line in failed), ""]
    return "\n".join(text)
