"""Headless Chromium for the pages that vgyro writes: what a page shows in a window of some width, and what it complains of."""

import html
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

CHROMIUM = shutil.which("chromium")

# Runs before everything else on the page: keeps what goes wrong.
LISTENER = """<script>
window.problems = [];
for (const kind of ["error", "warn"]) console[kind] = (...what) => problems.push(kind + ": " + what.join(" "));
addEventListener("error", (event) => problems.push("uncaught: " + event.message), true);
addEventListener("unhandledrejection", (event) => problems.push("rejected: " + event.reason));
addEventListener("securitypolicyviolation", (event) => problems.push("policy: " + event.violatedDirective));
</script>"""

# Runs after it: what can be seen. Pixels are counted by the colour that the curve's role has in the style.
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
  const roles = ROLES;
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
  seen.followed = [];
  for (const key of charts.length > 0 ? ["+", "ArrowRight", "Escape"] : []) { press(key); seen.ranges.push(range()); seen.followed.push(plots.filter((one) => one.chart).map((one) => one.chart.xAxisRange())); }
  const out = document.createElement("pre");
  out.id = "seen";
  out.textContent = JSON.stringify(seen);
  document.body.append(out);
}, 300));
</script>"""


def chromium(folder, *options):
    return subprocess.run([CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile", "--no-first-run",
                           "--virtual-time-budget=5000", *options], capture_output=True, check=True, timeout=100)


def visit(page, roles, width, *options):
    """What the probe saw of the page; `roles`: the colours, by their names in the style, whose pixels are counted in each plot."""
    with tempfile.TemporaryDirectory(prefix="vgyro-page-") as folder:
        path = Path(folder) / "page.html"
        page = page.replace('<meta charset="utf-8">', '<meta charset="utf-8">' + LISTENER, 1)
        path.write_text(page.replace("</body>", PROBE.replace("ROLES", json.dumps(roles)) + "</body>"))
        done = chromium(folder, "--enable-logging=stderr", f"--window-size={width},2000", *options, "--dump-dom", path.as_uri())
    said = [line for line in done.stderr.decode(errors="replace").splitlines() if "CONSOLE" in line]
    said = [line for line in said if "willReadFrequently" not in line]  # the probe itself reads canvases
    found = re.search(r'<pre id="seen">(.*?)</pre>', done.stdout.decode(), re.DOTALL)
    if said or not found:
        raise AssertionError(said or "the page did not come to its end")
    return json.loads(html.unescape(found.group(1)))


def pages_printed(page):
    with tempfile.TemporaryDirectory(prefix="vgyro-page-") as folder:
        path = Path(folder) / "page.html"
        path.write_text(page)
        chromium(folder, f"--print-to-pdf={folder}/page.pdf", path.as_uri())
        return len(re.findall(rb"/Type\s*/Page\b", (Path(folder) / "page.pdf").read_bytes()))


def needs_nothing_else(test, page):
    """It is mailed and archived; nothing may be missing then."""
    without_data = re.sub(r'<script type="application/json".*?</script>', "", page, flags=re.DOTALL)
    test.assertEqual(re.findall(r'<(?:script|img|iframe|link)[^>]*\s(?:src|href)="(?!data:)', without_data), [])
    test.assertEqual(re.findall(r"url\(\s*['\"]?(?!data:)[a-z]+:", without_data), [])
    test.assertIn("default-src 'none'", page)
    test.assertNotIn("sourceMappingURL", page)


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL).group(1))
