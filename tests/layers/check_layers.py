#!/usr/bin/python3
"""Fails if a source includes what its layer must not use: another layer against the arrows, the CAN headers of the
operating system, systemd, Eigen, iostreams, or a clock."""

import argparse
import os
import re
import sys
import tempfile
from pathlib import Path

# Layer → the layers whose headers it may include.
ARROWS = {
    "base": {"base"},
    "can": {"base", "can"},
    "canlog": {"base", "can", "canlog"},
    "dbc": {"base", "dbc"},
    "model": {"base", "model"},
    "simulation": {"base", "model", "simulation"},
    "fusion": {"base", "model", "fusion"},
    "analysis": {"base", "analysis"},
    "gap": {"base", "model", "analysis", "gap"},
    "fleet": {"base", "model", "fleet"},
    "gateway": {"base", "can", "dbc", "model", "fusion", "gateway"},
    "daemon": {"base", "can", "canlog", "dbc", "gateway", "daemon"},
    "cli": {"base", "can", "canlog", "dbc", "model", "simulation", "fusion", "analysis", "gap", "fleet", "gateway", "cli"},
}

# The gap workflow is as large as all other layers together, so it has arrows of its own: file → the files of its folder
# that it may include. The search uses the files that only compute answers; these do not include the search.
GAP_BASE = {"curve", "median", "recording", "result", "kinds"}
GAP_DATA = GAP_BASE | {"noise", "signals", "observations", "unseen_motion"}
GAP_REGRESSION = GAP_DATA | {"least_squares", "regression", "found"}
GAP_STUDY = GAP_DATA | {"transport", "timing", "study"}
GAP_ARROWS = {
    "curve": {"median"}, "median": set(), "recording": set(), "result": {"drive_evidence"}, "least_squares": set(), "kinds": set(),
    "wiener": {"curve", "median"},
    "unseen_motion": {"curve", "kinds", "noise"},
    "signals": {"curve", "median", "recording"},
    "noise": {"kinds"},
    "found": {"result"},
    "evidence": {"kinds"},
    "transport": {"median", "recording", "result"},
    "timing": {"curve", "median", "recording", "result", "transport", "wiener", "unseen_motion"},
    "spikes": {"curve", "median", "recording", "result", "timing", "transport"},
    "rest": {"recording", "transport"},
    "observations": GAP_DATA - {"observations"},
    "regression": GAP_DATA | {"least_squares"},
    "periodogram": GAP_DATA,
    "whiteness": GAP_DATA,
    "views": GAP_DATA,
    "scan": GAP_REGRESSION | {"periodogram"},
    "noise_search": GAP_REGRESSION,
    "acceptance": {"result", "found"},
    "steadiness": GAP_REGRESSION,
    "robust": GAP_REGRESSION,
    "study": GAP_DATA | {"rest", "spikes", "timing", "transport", "wiener"},
    "identifiable": GAP_STUDY,
    "score": GAP_STUDY,
    "figures": GAP_STUDY | {"views"},
    "describe": GAP_STUDY | {"views", "evidence"},
    "differences": GAP_STUDY | GAP_REGRESSION | {"scan", "views", "evidence"},
    "search": GAP_STUDY | GAP_REGRESSION | {"acceptance", "scan", "noise_search", "robust", "steadiness"},
    "drive_evidence": set(),
    "weigh": GAP_STUDY | GAP_REGRESSION | {"scan", "drive_evidence"},
    "leftover": GAP_STUDY | {"score", "search", "whiteness"},
    "workflow": GAP_STUDY | {"acceptance", "describe", "differences", "figures", "identifiable", "leftover", "score", "search", "weigh"},
}

# Pattern of an included header → the files that may include it.
SYSTEM_HEADERS = (
    (r"linux/can.*|net/if\.h", r"can/socket\.(h|cpp)"),
    # daemon/service.cpp sends to the service manager.
    (r"sys/socket\.h|sys/un\.h", r"can/socket\.(h|cpp)|daemon/service\.cpp"),
    (r"systemd/.*", r"daemon/.*|cli/status/gateway_client\.cpp"),
    (r"Eigen/.*|unsupported/Eigen/.*", r"(fusion|analysis|gap|fleet)/.*"),
    (r"iostream|istream|ostream|fstream|sstream|iomanip", r"(base|daemon|cli)/.*"),
)

CLOCK = re.compile(r"(?:::|\.)now\s*\(|\bnow\s*\(\s*\)|\bclock_gettime\s*\(|\bgettimeofday\s*\(|(?<![\w.>])(?:std::|::)?time\s*\(|\btimespec_get\s*\(")
CLOCK_FILES = re.compile(r"(daemon|cli)/.*|can/socket\.cpp")

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
COMMENT_OR_STRING = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)


def without_comments_and_strings(text):
    """`text` with comments and strings removed; line numbers stay."""
    return COMMENT_OR_STRING.sub(lambda m: "\n" * m.group().count("\n"), text)


def sources(root):
    for layer in ARROWS:
        for path in sorted((root / layer).rglob("*")):
            if path.suffix in (".h", ".cpp"):
                yield layer, path


def gap_complaint(file, other):
    if file not in GAP_ARROWS:
        return f"gap/{file} has no arrows in tests/layers/check_layers.py"
    if other != file and other not in GAP_ARROWS[file]:
        return f"gap/{file} includes gap/{other}.h; it may include {', '.join(sorted(GAP_ARROWS[file])) or 'none'} only"
    return None


def include_complaint(root, layer, name, quote, header):
    for pattern, allowed in SYSTEM_HEADERS:
        if re.fullmatch(pattern, header) and not re.fullmatch(allowed, name):
            return f"includes <{header}>, which only {allowed} may"
    first = header.split("/")[0]
    if first in ARROWS and "/" in header:
        if first not in ARROWS[layer]:
            return f"{layer} includes {header}; it may include {', '.join(sorted(ARROWS[layer]))} only"
        if layer == first == "gap":
            return gap_complaint(Path(name).stem, Path(header).stem)
    elif quote == '"':
        return f'includes "{header}", which is no path from the root such as "{layer}/{Path(header).name}"'
    return None


def complaints(root):
    """All violations below root, as "file:line: what"."""
    found = []
    for layer, path in sources(root):
        name = path.relative_to(root).as_posix()
        text = path.read_text(encoding="utf-8")
        for number, line in enumerate(text.splitlines(), 1):
            match = INCLUDE.match(line)
            what = match and include_complaint(root, layer, name, *match.groups())
            if what:
                found.append(f"{name}:{number}: {what}")
        if not CLOCK_FILES.fullmatch(name):
            for number, line in enumerate(without_comments_and_strings(text).splitlines(), 1):
                if CLOCK.search(line):
                    found.append(f"{name}:{number}: reads a clock; time enters through the drivers only")
    return found


PLANTED = (  # file, text, is it a breach?
    ("base/a.h", '#include "can/frame.h"', True),
    ("can/a.cpp", '#include "dbc/codec.h"', True),
    ("dbc/a.cpp", '#  include "can/frame.h"', True),
    ("fusion/a.cpp", '#include "dbc/codec.h"', True),
    ("fusion/b.cpp", '#include "gateway/plan.h"', True),
    ("model/a.cpp", '#include "fusion/compensation.h"', True),
    ("daemon/c.cpp", '#include "model/file.h"', True),
    ("daemon/d.cpp", '#include "canlog/candump.h"', False),
    ("simulation/a.cpp", '#include "fusion/compensation.h"', True),
    ("gateway/a.cpp", '#include "daemon/loop.h"', True),
    ("gap/scan.cpp", '#include "gap/search.h"', True),
    ("gap/kinds.cpp", '#include "gap/noise.h"', True),
    ("gap/regression.h", '#include "gap/study.h"', True),
    ("gap/a.cpp", '#include "gap/noise.h"', True),
    ("gap/search.cpp", '#include "gap/scan.h"\n#include "gap/search.h"', False),
    ("gateway/b.cpp", '#include <cli/replay.h>', True),
    ("analysis/a.cpp", '#include "can/frame.h"', True),
    ("daemon/a.cpp", '#include "fusion/mutual.h"', True),
    ("cli/a.cpp", '#include "daemon/loop.h"', True),
    ("can/b.cpp", "#include <linux/can/raw.h>", True),
    ("cli/status/gateway_client.cpp", "#include <systemd/sd-bus.h>", False),
    ("gateway/c.cpp", "#include <sys/socket.h>", True),
    ("daemon/bus.cpp", "#include <sys/socket.h>", True),
    ("daemon/service.cpp", "#include <linux/can.h>", True),
    ("can/c.cpp", "#include <net/if.h>", True),
    ("cli/b.cpp", "#include <systemd/sd-event.h>", True),
    ("dbc/b.cpp", "#include <Eigen/Dense>", True),
    ("gateway/i.cpp", "#include <Eigen/Dense>", True),
    ("model/b.h", "#include <Eigen/Core>", True),
    ("gateway/d.cpp", "#include <iostream>", True),
    ("gateway/e.cpp", '#include "plan.h"', True),
    ("fusion/c.cpp", "auto t = std::chrono::steady_clock::now();", True),
    ("can/d.cpp", "clock_gettime(CLOCK_REALTIME, &t);", True),
    ("can/e.cpp", "seed = time(nullptr);", True),
    ("gateway/f.cpp", "seed = std::time (nullptr);", True),
    ("gateway/sub/g.cpp", '#include "daemon/loop.h"', True),
    ("can/socket.cpp", "#include <linux/can/raw.h>\n#include <sys/socket.h>\n#include <net/if.h>", False),
    ("daemon/b.cpp", "#include <systemd/sd-event.h>\nauto t = BusClock::now();", False),
    ("fusion/d.cpp", '#include <Eigen/Dense>\n#include "base/time.h"\n#include "fusion/window.h"', False),
    ("gateway/h.cpp", '// no now() here\nconst char* s = "now()"; double x = lead_time(1); f.time(3); /* time(0)\n now() */', False),
    ("base/b.cpp", "std::vector<int> now(size);\n#include <fstream>", False),
    ("cli/c.cpp", '#include "analysis/allan.h"\n#include <iostream>', False),
)


def self_test():
    failed = []
    for name, text, is_breach in PLANTED:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            path.parent.mkdir(parents=True)
            path.write_text(text + "\n", encoding="utf-8")
            found = complaints(Path(folder))
        if bool(found) != is_breach:
            failed.append(f"{name} ({text!r}): {'missed' if is_breach else found}")
    return failed


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    default = os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2])
    parser.add_argument("root", nargs="?", type=Path, default=Path(default))
    root = parser.parse_args().root
    problems = [f"self-test: {f}" for f in self_test()] + complaints(root)
    checked = sum(1 for _ in sources(root))
    if checked == 0:
        problems.append(f"{root}: no sources found")
    print("\n".join(problems) if problems else f"{checked} sources, {len(PLANTED)} planted cases: no breach")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
