#!/usr/bin/python3
"""Fails when a tracked file holds what does not belong into a repository (a path of somebody's machine,
a registry's host, a note to oneself, megabytes), when a function is longer than it may be, or when ARCHITECTURE.md
names a test that does not exist."""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from check_layers import ARROWS
from function_lengths import UnbalancedBraces, function_lengths

BYTES_MAX = 2_000_000
# The strings are split so that this file does not match them itself.
FORBIDDEN = (
    (re.compile(r"(?<![\w.])/(?:work|home|root|Users|mnt)/" + r"\w"), "path of one machine"),
    (re.compile(r"\b(?:registry\.|[\w-]+\.(?:pkg|gcr|jfrog|artifactory)\.|ghcr\.|quay\.)" + r"[\w-]+"), "registry host"),
    (re.compile(r"\b(?:TO" + r"DO|FIX" + r"ME|XX" + r"X)\b"), "note to oneself"),
    (re.compile(r"\.\./" + r"shared\b"), "path outside the repository"),
)
# The CI configuration may name the machine's folder of recordings.
MACHINE_FILES = re.compile(r"\.ci/.*")
# Third-party names that only look like a note.
NOT_NOTES = re.compile(r"Vector__" + "XX" + "X")

SOURCES = re.compile(rf"(?:{'|'.join(ARROWS)})/.*\.(?:h|cpp)")
LINES_MAX = 60

INVARIANT = re.compile(r"^\s*(\d+)\.\s")
TEST_NAMES = re.compile(r"(?:\*tests?:\*|\(tests?:)\s*(.+)")
QUOTED = re.compile(r"`([^`]+)`")
GOOGLE_TEST = re.compile(r"\b(?:TYPED_)?TEST(?:_F|_P)?\s*\(\s*(\w+)\s*,\s*(\w+)\s*\)")
PYTHON_TEST = re.compile(r"^class (\w+)|^    def (test_\w+)", re.MULTILINE)


def tracked(root):
    listed = subprocess.run(["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                            capture_output=True, check=False)
    if listed.returncode == 0:
        names = [n for n in listed.stdout.decode().split("\0") if n]
    else:  # an unpacked archive
        names = [p.relative_to(root).as_posix() for p in sorted(root.rglob("*"))
                 if p.is_file() and not {"build", ".git"} & set(p.relative_to(root).parts)]
    return [n for n in names if (root / n).is_file()]


def text_complaints(root, name):
    path = root / name
    if path.stat().st_size > BYTES_MAX:
        return [f"{name}: larger than {BYTES_MAX} bytes"]
    data = path.read_bytes()
    if b"\0" in data or MACHINE_FILES.fullmatch(name):
        return []
    found = []
    for number, line in enumerate(data.decode("utf-8", errors="replace").splitlines(), 1):
        line = NOT_NOTES.sub("", line)
        for pattern, what in FORBIDDEN:
            match = pattern.search(line)
            if match:
                found.append(f"{name}:{number}: {what}: {match.group()!r}")
    return found


def known_tests(root):
    """Suite.Name of GoogleTest, Class.test_name of Python's unittest, and the names of suites and classes."""
    names = set()
    for path in sorted((root / "tests").rglob("*")):
        if path.suffix == ".cpp":
            for suite, name in GOOGLE_TEST.findall(path.read_text(encoding="utf-8", errors="replace")):
                names |= {suite, f"{suite}.{name}"}
        elif path.suffix == ".py":
            suite = None
            for class_name, test_name in PYTHON_TEST.findall(path.read_text(encoding="utf-8", errors="replace")):
                suite = class_name or suite
                names |= {suite} if class_name else {f"{suite}.{test_name}"}
    return names


def invariants(text):
    """(line number, number, text) of every numbered item in sections with "invariant" in their title."""
    inside, item = False, None
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#"):
            if item:
                yield item
            inside, item = "invariant" in line.lower(), None
            continue
        match = INVARIANT.match(line)
        if inside and match:
            if item:
                yield item
            item = (number, match.group(1), line)
        elif inside and item and line.strip():
            item = (item[0], item[1], f"{item[2]} {line.strip()}")
        elif item:
            yield item
            item = None
    if item:
        yield item


def invariant_complaints(root):
    name = "ARCHITECTURE.md"
    path = root / name
    if not path.is_file():
        return [f"{name}: is missing"]
    found, count, tests = [], 0, known_tests(root)
    for number, item, text in invariants(path.read_text(encoding="utf-8")):
        count += 1
        named = TEST_NAMES.search(text)
        quoted = QUOTED.findall(named.group(1)) if named else []
        if not quoted:
            found.append(f"{name}:{number}: invariant {item} names no test")
        for test in quoted:
            if test not in tests and not (root / test).exists():
                found.append(f"{name}:{number}: invariant {item} names `{test}`, which is neither a test nor a path")
    if count == 0:
        found.append(f"{name}: has no numbered invariants under a heading with that word")
    return found


def length_complaints(root, names):
    found = []
    for name in names:
        try:
            for function, _, lines in function_lengths((root / name).read_text(encoding="utf-8")):
                if lines > LINES_MAX:
                    found.append(f"{name}: {function}() has {lines} lines, more than {LINES_MAX}")
        except UnbalancedBraces as error:
            found.append(f"{name}: {error}")
    return found


def complaints(root):
    names = tracked(root)
    sources = [n for n in names if SOURCES.fullmatch(n)]
    return ([c for n in names for c in text_complaints(root, n)] + length_complaints(root, sources)
            + invariant_complaints(root))


def function_of(lines, name="f"):
    return f"int {name}(int a) {{\n" + "  a += '{';\n" * (lines - 2) + "}\n"


GOOD = {
    "gap/long.cpp": "namespace {\nconst int kList[] = {{1}, {2}};\n" + function_of(LINES_MAX) + "}\n",
    "gap/class.h": "class A {\n public:\n  A() : a_{1} {}\n" + "  int a_ = 0;\n" * LINES_MAX + "};\n",
    "ARCHITECTURE.md": "# Invariants\n\n1. Holds. — *test:* `Suite.Name`, `tests/a.cpp`\n2. Is\n   long. — *test:* `Oracle.test_x`\n",
    "tests/a.cpp": "TEST(Suite, Name) {}\nTEST_F(Other,\n       Long) {}\n",
    "tests/b.py": "class Oracle(Base):\n    def test_x(self):\n        pass\n",
    ".ci/run": "export VGYRO_RECORDINGS=.." + "/shared/data\n",
    "dbc/a.dbc": ' SG_ A : 0|8@1+ (1,0) [0|0] "" Vector__' + "XX" + "X\n",
}
PLANTED = (  # a file on top of GOOD that must be complained of
    ("base/a.h", "// see /" + "work/main\n"),
    ("base/b.h", '#include "/' + 'home/someone/a.h"\n'),
    ("base/c.h", "// TO" + "DO: later\n"),
    ("run", "pull registry" + ".example.org/image\n"),
    ("README.md", "data from .." + "/shared/data\n"),
    ("data.bin", "x" * (BYTES_MAX + 1)),
    ("gap/a.cpp", function_of(LINES_MAX + 1)),
    ("gap/b.cpp", "struct A {\n  A(int a)\n      : a_{a}, b_{a} {\n" + "    ++a_;\n" * LINES_MAX + "  }\n};\n"),
    ("gap/c.cpp", "int f() {\n"),
    ("ARCHITECTURE.md", "# Invariants\n\n1. Holds.\n"),
    ("ARCHITECTURE.md", "# Invariants\n\n1. Holds. — *test:* `Suite.Gone`\n"),
    ("ARCHITECTURE.md", "# Invariants\n\n1. Holds. — *test:* `tests/gone.py`\n"),
    ("ARCHITECTURE.md", "# Nothing\n"),
)


def found_in(files):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            path = Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return complaints(Path(folder))


def self_test():
    failed = [f"complained of a good tree: {c}" for c in found_in(GOOD)]
    for name, text in PLANTED:
        found = found_in(GOOD | {name: text})
        if len(found) != 1:
            failed.append(f"{name} ({text[:50]!r}): {found or 'missed'}")
    return failed


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    default = os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2])
    parser.add_argument("root", nargs="?", type=Path, default=Path(default))
    root = parser.parse_args().root
    problems = [f"self-test: {f}" for f in self_test()] + complaints(root)
    print("\n".join(problems) if problems else f"{len(tracked(root))} files, {len(PLANTED)} planted cases: nothing amiss")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
