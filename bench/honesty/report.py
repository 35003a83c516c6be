"""Tables of the results of many worlds, in Markdown."""

import statistics

import judge

GROUPS = (("motion", "motion"), ("drift", "drift"), ("fault", "fault"), ("pair", "pair"), ("bus", "on the bus"), ("knowledge", "known besides"))


def text(value, digits=3):
    return "" if value is None else f"{value:.{digits}g}"


def known(results, name):
    return [r["figures"][name] for r in results if r["figures"][name] is not None]


def count(results, kind):
    return sum(kind in r["failed"] for r in results)


def row(name, results):
    ratios = known(results, "ratio_late")
    cells = [name, str(len(results)), str(sum(bool(r["failed"]) for r in results))]
    cells += [str(count(results, kind) or "") for kind in judge.KINDS]
    cells += [text(statistics.median(ratios)) if ratios else "", text(max(ratios, default=None))]
    cells += [text(max(known(results, "beyond_6_s"), default=None)), text(max(known(results, "beyond_4_s"), default=None))]
    announced = known(results, "heading_announced")
    cells += [text(statistics.median(announced)), text(max(announced))]
    shares = known(results, "valid_sound")
    cells += [text(100 * min(shares)) if shares else ""]
    return "| " + " | ".join(cells) + " |"


HEAD = ("| | worlds | failed | " + " | ".join(judge.KINDS)
        + " | ratio, median | worst | longest beyond 6 σ, s | 4 σ, s | heading : σ, median | worst | least valid, % |\n"
        + "|---|" + "---:|" * 14)


def by_ingredient(results):
    lines = [HEAD, row("**all**", results)]
    for key, title in GROUPS:
        names = {}
        for r in results:
            for name in r["tags"][key]:
                names.setdefault(name, []).append(r)
        lines += [row(f"{title}: {name}", names[name]) for name in sorted(names)]
    return "\n".join(lines)


def failing(results, kinds):
    return sum(any(kind in r["failed"] for kind in kinds) for r in results)


def verdict(results):
    """Are the requirements met, kind by kind?"""
    lines = []
    for kinds, share in judge.ALLOWED.items():
        failed, allowed = failing(results, kinds), int(share * len(results))
        lines.append(f"{' or '.join(kinds)}: {failed} of {len(results)} worlds, {allowed} allowed{'' if failed <= allowed else ' ✗'}")
    return "\n".join(lines)


def passed(results):
    return all(failing(results, kinds) <= share * len(results) for kinds, share in judge.ALLOWED.items())


def one_world(result):
    f = result["figures"]
    return (f"seed {result['seed']}: {', '.join(result['failed']) or 'passed'}\n"
            f"    ratio {text(f['ratio_late'])}, beyond 6 σ {f['beyond_6_s']:.1f} s from {f['beyond_6_from_s']:.0f} s, "
            f"beyond 4 σ {f['beyond_4_s']:.1f} s from {f['beyond_4_from_s']:.0f} s, "
            f"heading {f['heading_announced']:.2f} of σ, valid {text(f['valid_sound'])}, without σ {text(f['without_sigma'])}, "
            f"worst {f['worst_dps']:.3g} deg/s\n    " + "; ".join(result["description"]))


def comparison(results, old):
    """Worlds that fail now and did not before, and the reverse; only worlds in both results."""
    before = {r["seed"]: r for r in old}
    pairs = [(before[r["seed"]], r) for r in results if r["seed"] in before]
    lines = [f"{len(pairs)} worlds in both runs"]
    for kind in judge.KINDS:
        new = [n["seed"] for o, n in pairs if kind in n["failed"] and kind not in o["failed"]]
        gone = [n["seed"] for o, n in pairs if kind not in n["failed"] and kind in o["failed"]]
        lines.append(f"{kind}: {count([o for o, _ in pairs], kind)} before, {count([n for _, n in pairs], kind)} now"
                     + (f"; mended: {shortened(gone)}" if gone else "") + (f"; new: {shortened(new)}" if new else ""))
    return "\n".join(lines)


def shortened(seeds, most=20):
    return " ".join(map(str, seeds[:most])) + (f" and {len(seeds) - most} more" if len(seeds) > most else "")
