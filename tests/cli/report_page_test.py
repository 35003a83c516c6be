#!/usr/bin/python3
"""The report page of a made-up result, in headless Chromium: it draws every plot, logs no error, fetches nothing,
and treats no name as markup. Without Chromium only its text is checked, and the test counts as skipped."""

import html
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
BIN = Path(os.environ.get("VGYRO_BIN", SOURCE / "build/release/bin"))
CHROMIUM = shutil.which("chromium")
SKIPPED = 77

HOSTILE = "</script><img src=x onerror=\"console.error('in')\">&amp; {{data}}"

# Runs before everything else on the page: records errors.
LISTENER = """<script>
window.problems = [];
for (const kind of ["error", "warn"]) console[kind] = (...what) => problems.push(kind + ": " + what.join(" "));
addEventListener("error", (event) => problems.push("uncaught: " + event.message), true);
addEventListener("unhandledrejection", (event) => problems.push("rejected: " + event.reason));
addEventListener("securitypolicyviolation", (event) => problems.push("policy: " + event.violatedDirective));
</script>"""

# Runs after the page: records what is visible. Pixels are counted by the colour that the curve's role has in the style.
PROBE = """<script>
addEventListener("load", () => setTimeout(() => {
  const rgb = (name) => {
    const probe = document.body.appendChild(document.createElement("i"));
    probe.style.color = `var(--${name})`;
    const parts = getComputedStyle(probe).color.match(/\\d+/g).map(Number);
    probe.remove();
    return parts;
  };
  const painted = (canvases, [r, g, b]) => {
    let count = 0;
    for (const canvas of canvases) {
      const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
      for (let i = 0; i < pixels.length; i += 4) {
        const off = Math.abs(pixels[i] - r) + Math.abs(pixels[i + 1] - g) + Math.abs(pixels[i + 2] - b);
        if (off < 24 && pixels[i + 3] > 160) ++count;
      }
    }
    return count;
  };
  const roles = ["before", "after", "simulated"];
  const charts = [...document.querySelectorAll(".chart")];
  const seen = {
    problems: window.problems,
    painted: charts.map((chart) => roles.map((role) => painted(chart.querySelectorAll("canvas"), rgb(role)))),
    text: document.body.innerText, title: document.title, images: document.images.length,
    background: getComputedStyle(document.body).backgroundColor,
    overflow: document.documentElement.scrollWidth - innerWidth,
    cut: [...document.querySelectorAll(".scroll, figure")].filter((box) => box.scrollWidth > box.clientWidth + 1).map((box) => box.innerText.slice(0, 60)),
  };
  seen.links = [...document.querySelectorAll("main a")].map((link) => link.getAttribute("href"));
  const press = (key) => charts[0].dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  const range = () => plots[0].chart.xAxisRange();
  seen.ranges = charts.length > 0 ? [range()] : [];
  for (const key of charts.length > 0 ? ["+", "ArrowRight", "Escape"] : []) { press(key); seen.ranges.push(range()); }
  const out = document.createElement("pre");
  out.id = "seen";
  out.textContent = JSON.stringify(seen);
  document.body.append(out);
}, 300));
</script>"""


class Page(unittest.TestCase):
    seen = {}

    @classmethod
    def setUpClass(cls):
        cls.page = subprocess.run([BIN / "report_page_sample"], stdout=subprocess.PIPE, check=True, timeout=60).stdout.decode()

    def look(self, width=1200, *options):
        """The result of the probe in a window of this width."""
        if not CHROMIUM:
            self.skipTest("chromium is not installed")
        if (width, options) not in self.seen:
            self.seen[width, options] = self.visit(width, *options)
        return self.seen[width, options]

    def visit(self, width, *options, page=None):
        with tempfile.TemporaryDirectory(prefix="vgyro-page-") as folder:
            path = Path(folder) / "report.html"
            page = (page or self.page).replace('<meta charset="utf-8">', '<meta charset="utf-8">' + LISTENER, 1)
            path.write_text(page.replace("</body>", PROBE + "</body>"))
            done = subprocess.run(
                [CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile", "--no-first-run",
                 "--enable-logging=stderr", f"--window-size={width},2000", "--virtual-time-budget=5000", *options, "--dump-dom", path.as_uri()],
                capture_output=True, check=True, timeout=100)
        said = [line for line in done.stderr.decode(errors="replace").splitlines() if "CONSOLE" in line]
        self.assertEqual([line for line in said if "willReadFrequently" not in line], [])  # this warning comes from the probe, which reads canvases
        found = re.search(r'<pre id="seen">(.*?)</pre>', done.stdout.decode(), re.DOTALL)
        self.assertTrue(found, "the page did not come to its end")
        return json.loads(html.unescape(found.group(1)))

    def test_holds_everything_itself(self):
        # The page is mailed and archived, so it must be complete by itself.
        without_data = re.sub(r'<script type="application/json".*?</script>', "", self.page, flags=re.DOTALL)
        self.assertEqual(re.findall(r'<(?:script|img|iframe|link)[^>]*\s(?:src|href)="(?!data:)', without_data), [])
        self.assertEqual(re.findall(r"url\(\s*['\"]?(?!data:)[a-z]+:", without_data), [])
        self.assertIn("default-src 'none'", self.page)
        self.assertNotIn("sourceMappingURL", self.page)

    def test_data_is_the_json_of_the_result(self):
        data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', self.page, re.DOTALL).group(1))
        self.assertEqual(data["gyros"], [HOSTILE, "b"])
        self.assertEqual(data["effects"][0]["kind"], "scale_factor")
        self.assertEqual(len(data["figures"]), 2)

    def test_draws_every_curve_and_complains_of_nothing(self):
        seen = self.look()
        self.assertEqual(seen["problems"], [])
        self.assertEqual(len(seen["painted"]), 2 + 2 * 3)
        for number, plot in enumerate(seen["painted"]):
            for role, pixels in zip(("before", "after", "simulated"), plot):
                self.assertGreater(pixels, 40, f"plot {number} does not show {role}")

    def test_tells_the_whole_story(self):
        text = self.look()["text"]
        for part in ("Partly explained", "What was found", "What gave it away", "Measured less predicted", "What remains",
                     "What could not be told", "What the numbers mean", "error -0.0004212 ± 3.1e-06", "record a rate table",
                     "line at 37.02 ± 0.01 Hz", "let it change by 10 K", "3 samples were left out"):
            self.assertIn(part, text)

    def test_the_first_page_of_several_axes_leads_to_each(self):
        page = subprocess.run([BIN / "report_page_sample", "axes"], stdout=subprocess.PIPE, check=True, timeout=60).stdout.decode()
        self.assertEqual(len(json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL).group(1))["axes"]), 2)
        if not CHROMIUM:
            self.skipTest("chromium is not installed")
        seen = self.visit(1200, page=page)
        self.assertEqual(seen["problems"], [])
        self.assertEqual(seen["images"], 0)
        self.assertEqual(seen["links"], ["report-x.html", "report-x.html", "report-y.html", "report-y.html"])
        for part in ("axis by axis", "partly explained", "What was found", "What remains", "its z", "its y", "error -0.0004212 ± 3.1e-06", HOSTILE):
            self.assertIn(part, seen["text"])

    def test_takes_no_name_for_markup(self):
        # The names of sensors and logs may contain anything.
        seen = self.look()
        self.assertIn(HOSTILE, seen["text"])
        self.assertIn(HOSTILE, seen["title"])
        self.assertEqual(seen["images"], 0)

    def test_zooms_with_the_keyboard_and_back(self):
        whole, near, moved, back = self.look()["ranges"]
        self.assertAlmostEqual((near[1] - near[0]) / (whole[1] - whole[0]), 0.5, places=2)
        self.assertGreater(moved[0], near[0])
        for a, b in zip(whole, back):
            self.assertAlmostEqual(a, b, places=6)

    def test_is_dark_where_the_user_wants_it(self):
        # Canvases take their colours from the style, like the page.
        seen = self.look(1200, "--blink-settings=preferredColorScheme=0")
        self.assertLess(sum(map(int, re.findall(r"\d+", seen["background"])[:3])), 3 * 60)
        self.assertTrue(all(pixels > 40 for plot in seen["painted"] for pixels in plot), seen["painted"])

    def test_fits_a_narrow_window(self):
        # Wider content scrolls inside its own box.
        for width in (500, 800, 1300):  # a headless window cannot be narrower
            self.assertLessEqual(self.look(width)["overflow"], 0, width)
            self.assertEqual(self.look(width)["cut"], [], f"tables and pictures wider than their place at {width}")

    def test_begins_with_degrees(self):
        # The made-up "before" is 2e-3·(1.5 + sin) deg/s, "after" a fifth of it.
        wave = [2e-3 * (1.5 + math.sin(2.0 * math.pi * i / 60.0)) for i in range(1, 101)]
        text = self.look()["text"]
        said = re.search(r"residual ([0-9.]+) → ([0-9.]+) deg/s rms; heading after 10 minutes ([0-9.]+) → ([0-9.]+) deg", text)
        self.assertTrue(said, text[:600])
        rms_before, rms_after, heading_before, heading_after = map(float, said.groups())
        self.assertAlmostEqual(rms_before, (sum(y * y for y in wave) / len(wave)) ** 0.5, delta=1e-4)
        self.assertAlmostEqual(rms_before / rms_after, 5.0, delta=0.5)
        self.assertAlmostEqual(heading_before, 600 * sum(wave) / len(wave), delta=0.06)
        self.assertAlmostEqual(heading_before / heading_after, 5.0, delta=0.5)
        self.assertLess(said.start(), text.index("nat"), "degrees come first")
        self.assertIn("−421.2 ± 3.1 ppm", text)

    def test_says_where_it_comes_from(self):
        text = self.look()["text"]
        for part in ("Where this comes from", "vgyro gap --config vgyro.toml --measured '" + HOSTILE, "2026-05-04 08:00:12 UTC",
                     "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"):
            self.assertIn(part, text)

    def test_prints_on_four_pages(self):
        if not CHROMIUM:
            self.skipTest("chromium is not installed")
        with tempfile.TemporaryDirectory(prefix="vgyro-page-") as folder:
            path = Path(folder) / "report.html"
            path.write_text(self.page)
            subprocess.run([CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile", "--no-first-run",
                            "--virtual-time-budget=5000", f"--print-to-pdf={folder}/report.pdf", path.as_uri()], capture_output=True, check=True, timeout=100)
            pages = len(re.findall(rb"/Type\s*/Page\b", (Path(folder) / "report.pdf").read_bytes()))
        self.assertTrue(1 <= pages <= 4, pages)


if __name__ == "__main__":
    outcome = unittest.main(exit=False).result
    if not outcome.wasSuccessful():
        sys.exit(1)
    sys.exit(SKIPPED if outcome.skipped else 0)
