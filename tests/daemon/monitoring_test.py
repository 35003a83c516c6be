"""The alert rules and the dashboard use only metrics and labels that the gateway writes. metrics_sample writes
all of them."""

import json
import os
import re
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

import yaml

FOLDER = Path(os.environ["VGYRO_SOURCE"]) / "monitoring"
SAMPLE = sys.argv.pop(1)

# Labels that Prometheus adds to every series.
ADDED = {"instance", "job"}
# Metrics of other programs, with their labels.
OTHERS = {"node_textfile_mtime_seconds": {"file"}}
# Labels whose values are names of the installation, not of vgyro.
FREE = {"gateway", "gyro", "bus", "message", "id", "version", "fingerprint", "method"} | ADDED

STRING = r'"(?:[^"\\]|\\.)*"'
SELECTOR = re.compile(rf"\b([a-z]\w*_\w+)(\{{(?:[^{{}}\"]|{STRING})*\}})?")
MATCHER = re.compile(rf"(\w+)\s*(=~|!~|!=|=)\s*({STRING})")
GROUPING = re.compile(r"\b(?:by|without|on|ignoring|group_left|group_right)\s*\(([^()]*)\)")
# Functions of PromQL whose names look like those of metrics, and those of Grafana.
FUNCTIONS = {"label_values", "label_replace", "histogram_quantile", "avg_over_time", "max_over_time", "min_over_time",
             "group_left", "group_right"}


def written():
    """Metric family → label → values of the label."""
    text = subprocess.run([SAMPLE], capture_output=True, text=True, check=True).stdout
    families = {}
    for line in text.splitlines():
        if line.startswith("# TYPE "):
            families[line.split()[2]] = {}
        elif not line.startswith("#"):
            name, labels = re.match(r"(\w+)\{(.*)\} \S+$", line).groups()
            for label, value in re.findall(rf"(\w+)=({STRING})", labels):
                families[name].setdefault(label, set()).add(json.loads(value))
    return families


def mistakes(expression, families, shown=()):
    """Metrics and labels that the expression, or a text that shows labels of its result, uses but the gateway does not write."""
    found = [f"{kind} {expression}" for kind, (a, b) in {"(": "()", "{": "{}", "[": "[]"}.items()
             if expression.count(a) != expression.count(b)]
    known = set(ADDED)
    asked = set(shown)
    for group in GROUPING.findall(expression):
        asked |= {label.strip() for label in group.split(",") if label.strip()}
    for name, matchers in SELECTOR.findall(GROUPING.sub("", expression)):
        if name in FUNCTIONS:
            continue
        if name not in families and name not in OTHERS:
            found.append(f"no metric {name}: {expression}")
            continue
        labels = families.get(name) if name in families else dict.fromkeys(OTHERS[name])
        known |= set(labels)
        for label, how, quoted in MATCHER.findall(matchers):
            value = json.loads(quoted.replace("\\.", "."))
            if label not in labels and label not in ADDED:
                found.append(f"{name} has no label {label}: {expression}")
            elif label not in FREE and labels[label] is not None and "$" not in value:
                words = value.split("|") if how in ("=~", "!~") else [value]
                found += [f"{name} has no {label}={word}: {expression}" for word in words if word not in labels[label]]
    return found + [f"no label {label}: {expression}" for label in sorted(asked - known)]


def queries(dashboard):
    """(expression, labels shown in its legend) of all panels, including those in rows."""
    for panel in dashboard["panels"]:
        for target in panel.get("targets", []):
            yield target["expr"], re.findall(r"\{\{\s*(\w+)\s*\}\}", target.get("legendFormat", ""))
        yield from queries(panel) if "panels" in panel else ()


class Monitoring(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.families = written()
        cls.rules = [rule for group in yaml.safe_load((FOLDER / "vgyro.rules.yml").read_text(encoding="utf-8"))["groups"]
                     for rule in group["rules"]]
        cls.dashboard = json.loads((FOLDER / "vgyro-dashboard.json").read_text(encoding="utf-8"))

    def test_the_rules_ask_for_what_is_written(self):
        self.assertGreater(len(self.rules), 10)
        for rule in self.rules:
            with self.subTest(alert=rule["alert"]):
                texts = " ".join(rule["annotations"].values())
                self.assertEqual(mistakes(rule["expr"], self.families, re.findall(r"\$labels\.(\w+)", texts)), [])

    def test_each_rule_has_a_name_a_severity_and_two_texts(self):
        names = [rule["alert"] for rule in self.rules]
        self.assertEqual(len(set(names)), len(names))
        for rule in self.rules:
            with self.subTest(alert=rule["alert"]):
                self.assertRegex(rule["alert"], r"^Vgyro[A-Z]\w+$")
                self.assertIn(rule["labels"]["severity"], ("critical", "warning"))
                self.assertEqual(set(rule["annotations"]), {"summary", "description"})
                self.assertRegex(rule.get("for", "1m"), r"^[0-9]+[smhd]$")

    def test_the_dashboard_asks_for_what_is_written(self):
        asked = list(queries(self.dashboard))
        self.assertGreater(len(asked), 10)
        for expression, shown in asked:
            with self.subTest(expression=expression):
                self.assertEqual(mistakes(expression, self.families, shown), [])
        for variable in self.dashboard["templating"]["list"]:
            if variable["type"] == "query":
                name, label = re.match(r"label_values\((\w+).*, (\w+)\)$", variable["query"]).groups()
                self.assertIn(label, set(self.families[name]) | ADDED)

    def test_the_panels_do_not_overlap(self):
        taken = set()
        for panel in self.dashboard["panels"]:
            place = panel["gridPos"]
            cells = {(x, y) for x in range(place["x"], place["x"] + place["w"])
                     for y in range(place["y"], place["y"] + place["h"])}
            self.assertLessEqual(place["x"] + place["w"], 24)
            self.assertFalse(taken & cells, panel["title"])
            taken |= cells
        self.assertEqual(len({panel["id"] for panel in self.dashboard["panels"]}), len(self.dashboard["panels"]))

    def test_a_mistake_is_found(self):
        for expression, shown in (("vgyro_rate_vald == 0", ()), ('vgyro_state{stat="running"}', ()),
                                  ('vgyro_state{state="runing"}', ()), ('vgyro_stops{verdict=~"open|shut"}', ()),
                                  ("sum by (gyr) (vgyro_gyro_frames_total)", ()), ("vgyro_bus_up", ("gyro",)),
                                  ("rate(vgyro_pairs_total[5m]", ())):
            with self.subTest(expression=expression):
                self.assertNotEqual(mistakes(expression, self.families, shown), [])

    @unittest.skipUnless(shutil.which("promtool"), "promtool is not installed (Debian: prometheus)")
    def test_promtool_accepts_the_rules(self):
        done = subprocess.run(["promtool", "check", "rules", FOLDER / "vgyro.rules.yml"], capture_output=True,
                              text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
