"use strict";
// Draws the course of a replay from the data in the page. All plots show the same time range.

const GYROS = [1, 2];
const PER_HOUR = 3600;
const READABLE_DPS = 0.3; // a drift beyond this has too many digits in deg/h to read
const gyroName = (gyro) => data.gyros[gyro - 1];
const beginUs = Math.min(...data.courses.map((course) => course.begin_us));

// --- numbers for people -------------------------------------------------------------------------

const minus = (text) => text.replace(/^-/, "−");

// Decimals that leave σ two significant digits.
function decimalsFor(sigma, most) {
  if (!(sigma > 0)) return 2;
  return Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), 0), most);
}

const degrees = (value, decimals) => minus(value.toFixed(decimals)) + "°";
const signed = (value, decimals) => (value >= 0 ? "+" : "") + degrees(value, decimals);

function duration(seconds) {
  if (seconds < 120) return `${seconds.toFixed(seconds < 10 ? 2 : 1)} s`;
  if (seconds < 2 * 3600) return `${(seconds / 60).toFixed(1)} min`;
  return `${(seconds / 3600).toFixed(2)} h`;
}

const spanS = Math.max(...data.courses.map((course) => course.t_s[course.t_s.length - 1] || 0));

// "1:02:03.5": hours only if the recording has any, seconds alone in a short one.
function clock(seconds, decimals) {
  const digits = decimals === undefined ? 2 : decimals;
  if (spanS < 120) return `${minus(seconds.toFixed(digits))} s`;
  const whole = Math.abs(Number(seconds.toFixed(digits)));
  const hours = Math.floor(whole / 3600), minutes = Math.floor((whole % 3600) / 60);
  const rest = (whole % 60).toFixed(digits).padStart(digits > 0 ? 3 + digits : 2, "0");
  const text = spanS < 3600 ? `${hours * 60 + minutes}:${rest}` : `${hours}:${String(minutes).padStart(2, "0")}:${rest}`;
  return (seconds < 0 ? "−" : "") + text;
}

// Round steps of time.
const STEPS_S = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200, 86400];

function timeTicks(from, to, pixels) {
  const LABEL_PX = 65;
  const most = Math.max(Math.floor(pixels / LABEL_PX), 1);
  const step = STEPS_S.find((candidate) => (to - from) / candidate <= most) || 86400 * Math.ceil((to - from) / 86400 / most);
  const decimals = step < 1 ? Math.ceil(-Math.log10(step) - 1e-9) : 0;
  const ticks = [];
  for (let k = Math.ceil(from / step); k * step <= to; ++k) ticks.push({ v: k * step, label: clock(k * step, decimals) });
  return ticks;
}

// --- result of the replay -----------------------------------------------------------------------

const offOf = (end, which) => end[`heading_${which}_deg`] - end.heading_virtual_deg;

function turned(course) {
  const { end } = course;
  const sigma = end.heading_sigma_deg;
  const decimals = decimalsFor(sigma, 4);
  return degrees(end.heading_virtual_deg, decimals) + (sigma === null ? "" : ` ± ${degrees(sigma, decimals)}`);
}

const off = (course, which) => signed(offOf(course.end, which), Math.max(decimalsFor(Math.abs(offOf(course.end, which)), 3), 0));

function whyNoRate() {
  const { summary } = data;
  if (summary.pair.contradiction !== "none") return "the two gyros contradict each other";
  if (summary.calibration.restarts > 0) return `the platform moved in every calibration (${summary.calibration.restarts} restarts)`;
  return `the calibration was not complete (${number(summary.calibration.covered_s, 3)} s)`;
}

function headline() {
  const valid = data.courses.filter((course) => course.end);
  if (valid.length === 0) return [make("p", { class: "headline" }, `No valid virtual rate: ${whyNoRate()}.`)];
  if (data.courses.length > 1) {
    const rows = valid.map((course) => [make("a", { href: `#axis-${course.axis}` }, course.axis), { number: turned(course) },
      { number: off(course, 1) }, { number: off(course, 2) }, { number: off(course, "mean") }]);
    return [make("p", { class: "headline" }, `In ${duration(valid[0].end.valid_to_s - valid[0].end.valid_from_s)} the platform turned, axis by axis:`),
      table(["axis", "virtual gyro", `${gyroName(1)} is off by`, `${gyroName(2)} by`, "their mean by"], rows)];
  }
  const [course] = valid;
  return [
    make("p", { class: "headline" }, `In ${duration(course.end.valid_to_s - course.end.valid_from_s)} the platform turned by ${turned(course)}.`),
    make("p", {}, `Without the virtual gyro the heading would be off: by ${off(course, 1)} with ${gyroName(1)} alone, ` +
      `by ${off(course, 2)} with ${gyroName(2)} alone, by ${off(course, "mean")} with their mean.`),
  ];
}

function headlineNote() {
  if (data.courses.every((course) => !course.end)) return [];
  const known = data.courses.some((course) => course.end && course.end.heading_sigma_deg !== null);
  return make("p", { class: "soft" }, "The virtual gyro is the rate that the gateway sends. Turns are counted from its first valid rate to its last. " +
    (known ? "± is one σ; it takes the error of the drifts for one that never changes sign, so it is an upper bound. " : "") +
    "A raw gyro's turn holds its drift from the beginning.");
}

function opening() {
  const { summary } = data;
  const began = new Date(beginUs / 1000);
  const when = beginUs > 0 && Number.isFinite(began.getTime()) ? ` from ${began.toISOString().replace("T", " ").replace(/\.\d+Z$/, " UTC")}` : "";
  return [
    make("h1", {}, "Replay"),
    make("p", { class: "soft" }, `${data.log}: ${duration(summary.last_s - summary.first_s)}${when}. Method: ${summary.method}. ` +
      `Configuration: ${data.config}.${summary.model ? ` Model: ${summary.model.file}.` : ""} Ended in state ${summary.final_state}.`),
    headline(), headlineNote(),
  ];
}

// --- one legend ---------------------------------------------------------------------------------

const SERIES = [["virtual", "virtual gyro, band ±σ"], ["gyro_1", gyroName(1)], ["gyro_2", gyroName(2)], ["mean", "mean of both"]];

function legend() {
  const shades = new Map();
  for (const course of data.courses) for (const { shade, name } of course.stretches) if (!shades.has(shade)) shades.set(shade, name);
  return make("div", { class: "legend all" },
    SERIES.map(([key, name]) => make("span", {}, make("i", { class: "swatch line", style: `background: var(--${key})` }), name)),
    [...shades].map(([shade, name]) => make("span", {}, make("i", { class: "swatch box", style: `background: var(--${shade})` }), shade.startsWith("fault") ? name.split(": ")[0] + " has a fault" : name)));
}

// --- plots --------------------------------------------------------------------------------------

const valueAt = (column, i) => (column === undefined || column[i] === null ? null : column[i] === "break" ? NaN : column[i]);

// One curve: [low, middle, high] for each instant.
function curve(key, label, columns, names, scale = 1) {
  const middle = columns[names.middle];
  if (middle === undefined) return null;
  const bars = middle.map((_, i) => {
    const y = valueAt(middle, i);
    if (y === null) return [null, null, null];
    let low = y, high = y;
    if (names.sigma && columns[names.sigma]) {
      const sigma = valueAt(columns[names.sigma], i);
      if (Number.isFinite(sigma) && sigma !== null) [low, high] = [y - sigma, y + sigma];
    } else if (columns[names.middle + "_least"]) {
      [low, high] = [valueAt(columns[names.middle + "_least"], i), valueAt(columns[names.middle + "_greatest"], i)];
    }
    return [low * scale, y * scale, high * scale];
  });
  return { key, label, bars };
}

// Difference of a heading from the virtual one; for the virtual one itself, 0 ± σ.
function offCurve(key, label, columns, name) {
  const own = columns.heading_virtual, other = columns[name], sigma = columns.heading_sigma;
  if (own === undefined || other === undefined) return null;
  return { key, label, bars: own.map((_, i) => {
    const a = valueAt(other, i), b = valueAt(own, i);
    if (Number.isNaN(a) || Number.isNaN(b)) return [NaN, NaN, NaN];
    if (a === null || b === null) return [null, null, null];
    const half = key === "virtual" ? valueAt(sigma, i) || 0 : 0;
    return [a - b - half, a - b, a - b + half];
  }) };
}

// σ comes less often than the drift.
function driftBand(columns, gyro, scale) {
  const drift = columns[`drift_${gyro}`], sigma = columns[`drift_sigma_${gyro}`];
  if (drift === undefined || sigma === undefined) return null;
  return { key: "drift", label: "±σ", band: true, bars: drift.map((_, i) => {
    const y = valueAt(drift, i), half = valueAt(sigma, i);
    if (y === null || half === null || !Number.isFinite(half)) return [null, null, null];
    return [(y - half) * scale, y * scale, (y + half) * scale];
  }) };
}

const headingCurves = (make1, names) => [make1("gyro_1", gyroName(1), names(1)), make1("gyro_2", gyroName(2), names(2)), make1("mean", "mean", names("mean")), make1("virtual", "virtual", names("virtual"))];

function largest(columns, names) {
  return Math.max(0, ...names.map((name) => (columns[name] || []).reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0)));
}

function panelsOf(course) {
  const { columns } = course;
  const plain = (key, label, middle) => curve(key, label, columns, { middle, sigma: key === "virtual" && middle.startsWith("heading") ? "heading_sigma" : undefined });
  const thinned = columns.rate_virtual_least || columns.rate_mean_least;
  const panels = [
    { title: "Heading, deg", high: true, curves: headingCurves(plain, (which) => `heading_${which}`) },
    { title: "Heading off the virtual gyro, deg", curves: headingCurves((key, label, name) => offCurve(key, label, columns, name), (which) => `heading_${which}`) },
    { lanes: true, title: "What went on" },
    { title: "Rate, deg/s", note: thinned ? `mean of ${number(course.step_s, 3)} s; the band reaches from the least to the greatest value` : "",
      curves: headingCurves(plain, (which) => `rate_${which}`) },
  ];
  const perHour = largest(columns, ["drift_1", "drift_2"]) <= READABLE_DPS;
  const scale = perHour ? PER_HOUR : 1;
  for (const gyro of GYROS) {
    if (!columns[`drift_${gyro}`] || !columns[`excess_${gyro}`]) continue;
    const range = course.drift_ranges_dps[gyro - 1];
    panels.push({ title: `Drift of ${gyroName(gyro)}, ${perHour ? "deg/h" : "deg/s"}`, low: true, note: "dots: the gyro less the virtual gyro; line: its learned drift, with ±σ",
      range: range && range.map((end) => end * scale),
      curves: [{ ...curve(`gyro_${gyro}`, "measured", columns, { middle: `excess_${gyro}` }, scale), points: true }, driftBand(columns, gyro, scale),
        curve("drift", "drift", columns, { middle: `drift_${gyro}` }, scale)] });
  }
  panels.push({ title: "Temperature, °C", low: true, curves: GYROS.map((gyro) => plain(`gyro_${gyro}`, gyroName(gyro), `temperature_${gyro}`)) });
  return panels.map((panel) => ({ ...panel, course, curves: (panel.curves || []).filter(Boolean) }))
    .filter((panel) => (panel.lanes ? course.stretches.length > 0 : panel.curves.length > 0));
}

function dotPlotter(event) {
  const ctx = event.drawingContext;
  ctx.save();
  ctx.fillStyle = event.color;
  ctx.globalAlpha = 0.55;
  for (const point of event.points) {
    if (Number.isFinite(point.canvasy)) ctx.fillRect(point.canvasx - 1, point.canvasy - 1, 2, 2);
  }
  ctx.restore();
}

// Shades the stretches of time, behind the curves.
function shade(ctx, area, chart, course) {
  const TINT = 0.2, FAULT_TINT = 0.12, LEAST_PX = 1;
  ctx.save();
  for (const { shade: key, spans_s: spans } of course.stretches) {
    ctx.fillStyle = colour(key);
    ctx.globalAlpha = key.startsWith("fault") ? FAULT_TINT : TINT;
    for (const [from, to] of spans) {
      const left = Math.max(chart.toDomXCoord(from + offset(course)), area.x), right = Math.min(chart.toDomXCoord(to + offset(course)), area.x + area.w);
      if (right >= left) ctx.fillRect(left, area.y, Math.max(right - left, LEAST_PX), area.h);
    }
  }
  ctx.restore();
}

// Axes may begin at slightly different instants.
const offset = (course) => (course.begin_us - beginUs) / 1e6;
const instants = new Map(data.courses.map((course) => [course, course.t_s.map((t) => t + offset(course))]));

const Y_LABELS_PX = 66; // as in the style of the lanes
let window_ = [0, Math.max(spanS, 1e-3)];
let moving = false;

// All other plots follow the one that was moved.
function follow(range) {
  if (moving) return;
  moving = true;
  window_ = range;
  for (const entry of plots) {
    if (entry.lanes) drawLanes(entry);
    else if (entry.chart && String(entry.chart.xAxisRange()) !== String(range)) entry.chart.updateOptions({ dateWindow: range });
  }
  moving = false;
}

function readoutOf(entry, row) {
  const { panel } = entry;
  const parts = panel.curves.filter((one) => !one.band && one.bars[row][1] !== null && Number.isFinite(one.bars[row][1])).map((one) => {
    const [low, middle, high] = one.bars[row];
    const spread = high - low > 1e-9 * Math.abs(middle) && panel.title.startsWith("Heading") ? ` ± ${number((high - low) / 2, 2)}` : "";
    return make("span", {}, make("i", { class: "swatch", style: `background: var(--${one.key})` }), `${one.label}: ${number(middle, 6)}${spread}`);
  });
  return [make("span", {}, `at ${clock(instants.get(panel.course)[row])}`), ...parts];
}

function lanesReadout(course, t) {
  const names = course.stretches.filter(({ spans_s: spans }) => spans.some(([from, to]) => t >= from && t <= to)).map(({ name }) => name);
  return [make("span", {}, `at ${clock(t + offset(course))}: ${names.join("; ") || "nothing out of the ordinary"}`)];
}

function point(course, row) {
  for (const entry of plots) {
    if (entry.panel.course !== course) continue;
    entry.readout.replaceChildren(...(entry.lanes ? lanesReadout(course, course.t_s[row]) : readoutOf(entry, row)));
    if (entry.chart && entry.chart.getSelection() !== row) entry.chart.setSelection(row);
  }
}

function unpoint(course) {
  for (const entry of plots) {
    if (entry.panel.course !== course) continue;
    entry.readout.replaceChildren(...(entry.panel.note ? [entry.panel.note] : []));
    if (entry.chart) entry.chart.clearSelection();
  }
}

function drawLanes(entry) {
  const { course } = entry.panel;
  const LEAST_OF_WINDOW = 0.0015; // a shorter stretch could not be seen
  const [from, to] = window_, least = LEAST_OF_WINDOW * (to - from);
  entry.host.replaceChildren(...course.stretches.map(({ shade: key, name, spans_s: spans }) => {
    const svg = drawing("svg", { viewBox: `0 0 1000 10`, preserveAspectRatio: "none", role: "img", "aria-label": `${name}: ${spans.length} times` });
    for (const [begin, end] of spans) {
      const left = begin + offset(course), right = Math.max(end + offset(course), left + least);
      if (right < from || left > to) continue;
      const x = (t) => (1000 * (t - from)) / (to - from);
      svg.append(drawing("rect", { x: x(Math.max(left, from)), y: 0, width: x(Math.min(right, to)) - x(Math.max(left, from)), height: 10, style: `fill: var(--${key})` }));
    }
    return make("div", { class: "lane" }, name, svg);
  }));
}

function plot(panel) {
  const readout = make("div", { class: "readout" }, panel.note || "");
  const host = panel.lanes ? make("div", { class: "lanes" })
    : make("div", { class: "chart" + (panel.high ? " high" : panel.low ? " low" : ""), tabindex: "0", role: "img", "aria-label": panel.title });
  plots.push({ host, panel, readout, lanes: panel.lanes });
  return make("figure", { class: "plot" }, make("figcaption", {}, panel.title), readout, framed(host));
}

const paint = (panel) => ({ colors: panel.curves.map((one) => colour(one.key)), gridLineColor: colour("line"), axisLineColor: colour("soft") });

function draw(entry) {
  const { host, panel } = entry;
  if (entry.lanes) return drawLanes(entry);
  const { course } = panel;
  const labels = panel.curves.map((one, i) => `${i + 1} ${one.label}`); // names may be alike
  const series = {};
  panel.curves.forEach((one, i) => {
    series[labels[i]] = one.points ? { plotter: dotPlotter, strokeWidth: 0 } : one.band ? { strokeWidth: 0 }
      : { strokeWidth: one.key === "virtual" || one.key === "drift" ? 2 : 1.2, ...(one.key === "mean" ? { strokePattern: [6, 3] } : {}) };
  });
  entry.chart = new Dygraph(host, instants.get(course).map((t, i) => [t, ...panel.curves.map((one) => one.bars[i])]), {
    labels: ["x", ...labels], series, ...paint(panel), dateWindow: window_, ...(panel.range ? { valueRange: panel.range } : { yRangePad: 8 }),
    customBars: true, fillAlpha: 0.22, connectSeparatedPoints: true, legend: "never", highlightCircleSize: 3, gridLineWidth: 0.6,
    axes: { x: { ticker: timeTicks, drawGrid: true }, y: { axisLabelFormatter: (value) => number(value, 4), axisLabelWidth: Y_LABELS_PX - 6 } },
    underlayCallback: (ctx, area, chart) => shade(ctx, area, chart, course),
    drawCallback: (chart, initial) => { if (!initial) follow(chart.xAxisRange()); },
    highlightCallback: (event, x, points, row) => point(course, row), unhighlightCallback: () => unpoint(course),
  });
  entry.chart.resetZoom = () => entry.chart.updateOptions({ dateWindow: [0, Math.max(spanS, 1e-3)], valueRange: panel.range || null });
  listenToKeys(host, entry.chart, false);
}

function repaint() {
  for (const { chart, panel } of plots) if (chart) chart.updateOptions(paint(panel));
}

// --- tables -------------------------------------------------------------------------------------

const dps = (value, sigma) => {
  if (!Number.isFinite(value)) return "–";
  const text = (scale, unit) => {
    const decimals = sigma > 0 ? decimalsFor(sigma * scale, 9) : 5;
    return `${minus((value * scale).toFixed(decimals))}${sigma > 0 ? ` ± ${(sigma * scale).toFixed(decimals)}` : ""} ${unit}`;
  };
  return Math.abs(value) > READABLE_DPS ? text(1, "deg/s") : `${text(PER_HOUR, "deg/h")} = ${text(1, "deg/s")}`;
};

// With several axes the summary has no σ, but the course has.
function lastSigma(axis, gyro) {
  const course = data.courses.find((one) => one.axis === axis);
  const known = ((course && course.columns[`drift_sigma_${gyro}`]) || []).filter(Number.isFinite);
  return known[known.length - 1];
}

function gyrosTable() {
  const { axes } = data.summary;
  const parts = axes ? axes.flatMap(({ axis, gyros }) => gyros.map((gyro, i) => [axis, gyro, i])) : data.summary.gyros.map((gyro, i) => ["", gyro, i]);
  const rows = parts.map(([axis, gyro, i]) => [...(axes ? [axis] : []), data.gyros[i], { number: String(gyro.samples) },
    { number: dps(gyro.bias_dps, gyro.bias_sigma_dps || lastSigma(axis, i + 1)) }]);
  return [make("h2", {}, "The gyros"), table([...(axes ? ["axis"] : []), "gyro", "samples", "drift at the end"], rows)];
}

function eventsTable() {
  const several = data.courses.length > 1;
  const rows = data.courses.flatMap((course) => course.stretches.map(({ name, spans_s: spans }) => {
    const lengths = spans.map(([from, to]) => to - from);
    const longest = spans[lengths.indexOf(Math.max(...lengths))];
    return [...(several ? [course.axis] : []), name, { number: String(spans.length) }, { number: duration(lengths.reduce((sum, one) => sum + one, 0)) },
      { number: `${clock(longest[0] + offset(course), 1)} to ${clock(longest[1] + offset(course), 1)}` }];
  }));
  if (rows.length === 0) return [];
  return [make("h2", {}, "What went on, in numbers"), table([...(several ? ["axis"] : []), "what", "times", "in all", "the longest"], rows)];
}

const WORDS = [
  ["Virtual gyro", "The one rate that the gateway makes of both gyros, their learned drifts taken off."],
  ["σ", "Standard error: 68 of 100 true values lie within ±σ, 95 within ±2 σ."],
  ["Drift", "What a gyro reads too much, in deg/s or deg/h. It is learned in the calibration, at stops and from the difference of the gyros."],
  ["Calibrating", "The first rest, in which both drifts are learned; no rate is valid before its end."],
  ["Stop learned, stop refused", "A steady stretch from which both drifts were learned; or one that was taken for a slow turn of the platform, from which nothing was learned."],
  ["Ambiguous", "The data can be read in two ways, and σ spans both."],
  ["One gyro alone", "The other one was silent or set aside; the rate is the remaining gyro's less its last drift."],
  ["Contradicted", "The two do not move as on one platform; no rate is valid."],
];

function words() {
  return [make("h2", {}, "What the words mean"), make("dl", {}, WORDS.map(([term, text]) => [make("dt", {}, term), make("dd", {}, text)]).flat())];
}

// --- the page -----------------------------------------------------------------------------------

function courseSection(course) {
  const several = data.courses.length > 1;
  return [...(several ? [make("h2", { id: `axis-${course.axis}` }, `About ${course.axis}`)] : []), panelsOf(course).map(plot)];
}

document.title = `vgyro replay: ${data.log}`;
document.getElementById("page").append(...[opening(), legend(), data.courses.map(courseSection), gyrosTable(), eventsTable(), words(),
  make("p", { class: "soft" }, `vgyro ${data.version}.`)].flat(4));
plots.forEach(draw);
watchPaper(700); // px of a plot's width: the whole page's
darkness.addEventListener("change", repaint);
