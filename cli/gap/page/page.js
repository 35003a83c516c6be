"use strict";
// Draws the gap report from the data in the page.

const SIGMAS = 2; // what bars and bands show

const sentence = (text) => text.replace(/^what /, "What ").replace(/\.?$/, "."); // it may begin with a sensor's name
const gyroName = (gyro) => (gyro ? data.gyros[gyro - 1] : "the reference");
const ownAxis = (part) => (part.axis ? `, its ${part.axis}` : ""); // of a whole unit
const effectName = (effect) => `${effect.kind}, gyro ${gyroName(effect.gyro)}${ownAxis(effect)}`;
const readings = (effect) => effect.ambiguous_with.map(effectName).join("; ");
const stretch = (from, to) => `${number(from, 4)} to ${number(to, 4)} s`;

// Where ppm is what one says: a scale factor's error.
function valueOf(effect) {
  const error = effect.parameters && effect.parameters.error;
  if (!Number.isFinite(error)) return effect.value;
  const sigma = effect.sigma && effect.sigma.error;
  const digits = sigma > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(sigma * 1e6)), 0), 6) : 1;
  const ppm = (value) => (value * 1e6).toFixed(digits).replace(/^-/, "−");
  return `${effect.value} (${ppm(error)}${sigma > 0 ? " ± " + ppm(sigma) : ""} ppm)`;
}

// --- what it means, in degrees ------------------------------------------------------------------

const HEADING_MINUTES = 10;

// Root mean square of a curve, and the heading that its mean adds up to.
function sizeOf(figure, role) {
  const curve = figure.curves.find((one) => roleOf(one.label) === role);
  const values = curve ? curve.y.filter((y) => Number.isFinite(y)) : [];
  if (values.length === 0) return null;
  const mean = values.reduce((sum, y) => sum + y, 0) / values.length;
  const square = values.reduce((sum, y) => sum + y * y, 0) / values.length;
  return { rms: Math.sqrt(square), heading: Math.abs(mean) * HEADING_MINUTES * 60 };
}

const plain = (value) => value.toLocaleString("en", { maximumSignificantDigits: 2, useGrouping: false });

function headline() {
  const lines = data.figures.map((gyro, i) => {
    const before = sizeOf(gyro.time, "before"), after = sizeOf(gyro.time, "after");
    if (!before || !after) return null;
    return make("p", { class: "headline" }, `Gyro ${data.gyros[i]}: residual ${plain(before.rms)} → ${plain(after.rms)} deg/s rms; ` +
      `heading after ${HEADING_MINUTES} minutes ${plain(before.heading)} → ${plain(after.heading)} deg.`);
  }).filter(Boolean);
  if (lines.length === 0) return [];
  return [...lines, make("p", { class: "soft" }, "Before and after what was found, of the means that the plots over time below show; the heading is what the mean of the residual " +
    `adds up to${data.recording.with_reference ? "" : ", as far as two gyros without a reference can show it"}.`)];
}

// --- the gap at a glance ------------------------------------------------------------------------

function gapRows() {
  const rows = [{ label: data.model ? "model as given" : "no model", value: data.gap.before }];
  for (const effect of data.effects)
    rows.push({ label: "+ " + effectName(effect) + (effect.applied ? "" : " (not applied)"), value: effect.gap_after });
  const last = rows[rows.length - 1].value;
  if (data.effects.length > 0 && Math.abs(last - data.gap.after) > 1e-9) {
    rows.push({ label: "final model", value: data.gap.after });
  }
  return rows;
}

// Linear inside the floor's band, logarithmic beyond: both ends of the story stay visible.
function gapScale(rows, left, right, [low, high] = data.gap.band95) {
  const half = Math.max(data.gap.floor - low, high - data.gap.floor, 1e-9);
  const squeeze = (value) => Math.asinh((value - data.gap.floor) / half);
  const all = rows.map((row) => squeeze(row.value)).concat([squeeze(low), squeeze(high)]);
  const least = Math.min(...all) - 0.8, most = Math.max(...all) + 0.5;
  return (value) => left + ((squeeze(value) - least) / (most - least)) * (right - left);
}

function gapTicks(at, left, right) {
  const ticks = [{ value: data.gap.floor, x: at(data.gap.floor) }];
  for (let decade = 6; decade >= -9; --decade) {
    const value = data.gap.floor + 10 ** decade;
    const x = at(value);
    if (x <= right && x >= left && ticks.every((tick) => Math.abs(tick.x - x) > 45)) ticks.push({ value, x });
  }
  return ticks;
}

const shortened = (text, most) => (text.length > most ? text.slice(0, most - 1) + "…" : text); // the table below has all of it
const NARROW_PX = 700; // below it a row's name stands above its mark

function gapFigure() {
  const rows = gapRows();
  const narrow = document.documentElement.clientWidth < NARROW_PX;
  const wide = narrow ? 360 : 900, left = narrow ? 14 : 270, right = narrow ? 346 : 850, top = narrow ? 64 : 30, step = narrow ? 52 : 34;
  const bottom = top + step * rows.length;
  const svg = drawing("svg", { viewBox: `0 0 ${wide} ${bottom + 46}`, role: "img",
    "aria-label": `gap ${number(data.gap.before, 3)} before, ${number(data.gap.after, 3)} after` });
  const at = gapScale(rows, left, right);
  const [low, high] = data.gap.band95.map(at);
  svg.append(drawing("rect", { x: low, y: top - 14, width: Math.max(high - low, 1), height: bottom - top + 14, style: "fill: var(--band)" }));
  svg.append(drawing("text", { x: (low + high) / 2, y: top - (narrow ? 32 : 18), "text-anchor": "middle", class: "soft" }, "as good as it gets"));
  for (const tick of gapTicks(at, left, right)) {
    svg.append(drawing("line", { x1: tick.x, x2: tick.x, y1: top - 14, y2: bottom, style: "stroke: var(--line)" }));
    svg.append(drawing("text", { x: tick.x, y: bottom + 16, "text-anchor": "middle", class: "soft" }, number(tick.value, 2)));
  }
  rows.forEach((row, i) => {
    const y = top + step * i + 8, x = at(row.value);
    const tone = row.value <= data.gap.band95[1] ? "after" : "before";
    if (i > 0) {
      const from = at(rows[i - 1].value);
      svg.append(drawing("path", { d: `M${from} ${y - step + 7} V${y} H${x}`, style: "fill: none; stroke: var(--soft); stroke-dasharray: 3 3" }));
    }
    svg.append(drawing("circle", { cx: x, cy: y, r: 7, style: `fill: var(--${tone})` }));
    const fromRight = x > right - 70 || (i > 0 && rows[i - 1].value > row.value && x > left + 70); // the dashed line comes from there
    svg.append(drawing("text", { x: fromRight ? x - 13 : x + 13, y: y + 4.5, "text-anchor": fromRight ? "end" : "start", style: "font-weight: 600" }, number(row.value, 3)));
    svg.append(narrow ? drawing("text", { x: left, y: y - 14 }, shortened(row.label, 44)) : drawing("text", { x: left - 16, y: y + 4.5, "text-anchor": "end" }, shortened(row.label, 34)));
  });
  svg.append(drawing("text", { x: (left + right) / 2, y: bottom + 38, "text-anchor": "middle", class: "soft" },
    narrow ? "gap, nats per sample" : "gap, nats per sample on samples that took no part; logarithmic beyond the band"));
  return make("figure", { id: "gap" }, make("figcaption", {}, "The gap, round by round"), svg);
}

// --- several axes -------------------------------------------------------------------------------

const mark = (x, y, style, title) => {
  const dot = drawing("circle", { cx: x, cy: y, r: 6, style });
  dot.append(drawing("title", {}, title));
  return dot;
};

// One row for each axis: from the gap before to the gap after, over the axis's own band.
function axesFigure() {
  const wide = 900, left = 120, right = 850, top = 46, step = 40;
  const bottom = top + step * data.axes.length;
  const svg = drawing("svg", { viewBox: `0 0 ${wide} ${bottom + 30}`, role: "img", "aria-label": "gap before and after, axis by axis" });
  const ends = data.axes.map((axis) => axis.gap.band95);
  const band = [Math.min(...ends.map((end) => end[0])), Math.max(...ends.map((end) => end[1]))];
  const at = gapScale(data.axes.flatMap((axis) => [{ value: axis.gap.before }, { value: axis.gap.after }]), left, right, band);
  for (const tick of gapTicks(at, left, right)) {
    svg.append(drawing("line", { x1: tick.x, x2: tick.x, y1: top - 14, y2: bottom, style: "stroke: var(--line)" }));
    svg.append(drawing("text", { x: tick.x, y: bottom + 16, "text-anchor": "middle", class: "soft" }, number(tick.value, 2)));
  }
  data.axes.forEach((axis, i) => {
    const y = top + step * (i + 0.5);
    const [low, high] = axis.gap.band95.map(at);
    const before = at(axis.gap.before), after = at(axis.gap.after);
    svg.append(drawing("rect", { x: low, y: y - 13, width: Math.max(high - low, 1), height: 26, style: "fill: var(--band)" }));
    svg.append(drawing("text", { x: left - 24, y: y + 5, "text-anchor": "end" }, `axis ${axis.axis}`));
    svg.append(drawing("line", { x1: before, x2: after, y1: y, y2: y, style: "stroke: var(--soft); stroke-width: 2" }));
    svg.append(mark(before, y, "fill: var(--before)", `before: ${number(axis.gap.before, 4)}`));
    svg.append(mark(after, y, "fill: var(--after)", `after: ${number(axis.gap.after, 4)}`));
  });
  svg.append(mark(left, 12, "fill: var(--before)", "before"), drawing("text", { x: left + 12, y: 16, class: "soft" }, "gap before"));
  svg.append(mark(left + 110, 12, "fill: var(--after)", "after"), drawing("text", { x: left + 122, y: 16, class: "soft" }, "after"));
  svg.append(drawing("rect", { x: left + 190, y: 4, width: 18, height: 16, style: "fill: var(--band)" }));
  svg.append(drawing("text", { x: left + 214, y: 16, class: "soft" }, "as good as it gets; nats per sample"));
  return make("figure", { id: "gap" }, svg);
}

const axisLink = (axis, text) => make("a", { href: axis.report || axis.file }, text || axis.axis);

function axesOpening() {
  const seconds = data.axes[0].recording.seconds;
  const found = (axis) => axis.effects.map((effect) => effectName(effect) + (effect.applied ? "" : " (not applied)")).join("; ") || "–";
  const rows = data.axes.map((axis) => [axisLink(axis), axis.verdict.replaceAll("_", " "), { number: number(axis.gap.before, 4) },
    { number: number(axis.gap.after, 4) }, found(axis), axisLink(axis, "report")]);
  rows.push(["all", data.verdict.replaceAll("_", " "), { number: number(data.gap.before, 4) }, { number: number(data.gap.after, 4) }, "", ""]);
  return [
    make("h1", {}, "Simulation and measurement, axis by axis"),
    make("p", { class: "soft" }, `${data.log}: ${number(seconds, 5)} s. Model: ${data.model || "none"}. Configuration: ${data.config}. ` +
      "Axes are the vehicle's; a gyro's own axis is named where an effect is of one."),
    axesFigure(),
    table(["axis", "verdict", "gap before", "after", "found", ""], rows),
  ];
}

function axesEffects() {
  const rows = data.axes.flatMap((axis) => axis.effects.map((effect) => [axis.axis, gyroName(effect.gyro) + ownAxis(effect), kindCell(effect.kind),
    { number: valueOf(effect) }, effect.applied ? "yes" : "no", readings(effect) || "–"]));
  return rows.length === 0 ? [] : [make("h2", {}, "What was found"), table(["axis", "gyro", "effect", "value ± σ", "in model.toml", "may also be"], rows)];
}

function axesRemains() {
  const rows = data.axes.flatMap((axis) => axis.unexplained.map((rest) => [axis.axis, gyroName(rest.gyro), rest.signature, rest.text, stretch(rest.from_s, rest.to_s)]));
  const heading = make("h2", {}, "What remains");
  if (rows.length === 0) return [heading, make("p", {}, "Nothing that stands out of what the final models' own simulations show.")];
  return [heading, table(["axis", "gyro", "signature", "what is seen", "when"], rows)];
}

function axesNotes() {
  return data.axes.flatMap((axis) => axis.notes.map((note) => make("p", { class: "soft" }, `Note on ${axis.axis}: ${note}.`)));
}

// Of one of several: the way to the others.
function otherPages() {
  if (!data.pages) return [];
  const links = data.pages.map((page) => (page.axis === data.axis ? make("b", {}, page.axis) : axisLink(page)));
  return [make("p", { class: "soft" }, make("a", { href: "report.html" }, "All axes"), ": ", links.flatMap((link) => [link, " "]))];
}

// --- plots --------------------------------------------------------------------------------------

const ROLES = ["simulated", "before", "other", "effect", "after"]; // drawn in this order

function roleOf(label) {
  if (/simul|floor/i.test(label)) return "simulated";
  if (/before|without/i.test(label)) return "before";
  if (/after|\bwith\b/i.test(label)) return "after";
  if (data.effects.some((effect) => effect.kind === label)) return "effect";
  return "other";
}

function pointPlotter(event) {
  const ctx = event.drawingContext;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = event.color;
  for (const point of event.points) {
    if (!Number.isFinite(point.canvasy)) continue;
    ctx.globalAlpha = 0.45;
    ctx.beginPath();
    ctx.moveTo(point.canvasx, event.dygraph.toDomYCoord(point.yval_minus));
    ctx.lineTo(point.canvasx, event.dygraph.toDomYCoord(point.yval_plus));
    ctx.stroke();
    ctx.globalAlpha = 0.9;
    ctx.beginPath();
    ctx.arc(point.canvasx, point.canvasy, 2.2, 0, 2 * Math.PI);
    ctx.fill();
  }
  ctx.restore();
}

// Curves of their own x → rows for dygraphs: one x, then one [low, mid, high] for each curve.
function rowsOf(curves, logY) {
  const marks = [];
  curves.forEach((curve, column) => curve.x.forEach((x, i) => {
    let y = curve.y[i] === null ? NaN : curve.y[i];
    if (logY && !(y > 0)) y = NaN;
    const half = curve.y_sigma ? SIGMAS * curve.y_sigma[i] : 0;
    const low = logY ? Math.max(y - half, y / 30) : y - half;
    marks.push({ x, column, bar: [low, y, y + half] });
  }));
  marks.sort((a, b) => a.x - b.x || a.column - b.column);
  const rows = [];
  for (const mark of marks) {
    let row = rows[rows.length - 1];
    if (!row || row[0] !== mark.x || row[mark.column + 1][1] !== null) {
      row = [mark.x, ...curves.map(() => [null, null, null])];
      rows.push(row);
    }
    row[mark.column + 1] = mark.bar;
  }
  return rows;
}

function logTicks(from, to) {
  const ticks = [];
  const few = Math.log10(to / from) > 4;
  for (let decade = Math.floor(Math.log10(from)); decade <= Math.log10(to); ++decade) {
    for (const part of Math.log10(to / from) < 1.5 ? [1, 2, 3, 5, 7] : [1, 2, 5]) {
      const v = part * 10 ** decade;
      if (v >= from * 0.999 && v <= to * 1.001) ticks.push({ v, label: few && part !== 1 ? "" : number(v, 2) });
    }
  }
  return ticks;
}

function axisOptions(log) {
  const options = { axisLabelFormatter: (value) => number(value, 3), valueFormatter: (value) => number(value, 4) };
  return log ? { ...options, logscale: true, ticker: (from, to) => logTicks(from, to) } : options;
}

function legendText(chart) {
  return chart.series.map((series) => {
    const value = series.yHTML === undefined || !series.isVisible ? "" : ": " + series.yHTML;
    return `<span><i class="swatch" style="background:${series.color}"></i>${series.labelHTML}${value}</span>`;
  }).join("") + (chart.xHTML ? `<span>at ${chart.xHTML}</span>` : "");
}

function paint(curves) {
  return { colors: curves.map((curve) => colour(roleOf(curve.label))), gridLineColor: colour("line"), axisLineColor: colour("soft") };
}

function plot(figure) {
  const legend = make("div", { class: "legend" });
  const host = make("div", { class: "chart", tabindex: "0", role: "img", "aria-label": figure.title });
  const node = make("figure", { class: "plot" }, make("figcaption", {}, figure.title), legend, framed(host));
  const curves = figure.curves.filter((curve) => curve.x.length > 0)
    .map((curve, i) => ({ ...curve, i }))
    .sort((a, b) => ROLES.indexOf(roleOf(a.label)) - ROLES.indexOf(roleOf(b.label)) || a.i - b.i);
  if (curves.length === 0) {
    host.replaceWith(make("p", { class: "soft" }, "nothing to draw"));
    return node;
  }
  plots.push({ host, legend, figure, curves });
  return node;
}

function draw(entry) {
  const { host, legend, figure, curves } = entry;
  const series = {};
  const labels = curves.map((curve, i) => {
    const label = curve.label + (curve.y_sigma ? ` ± ${SIGMAS}σ` : "");
    return curves.findIndex((other) => other.label === curve.label) === i ? label : `${label} (${i + 1})`;
  });
  curves.forEach((curve, i) => {
    series[labels[i]] = curve.points ? { plotter: pointPlotter, strokeWidth: 0 } : { strokeWidth: roleOf(curve.label) === "simulated" ? 1 : 1.4 };
  });
  entry.chart = new Dygraph(host, rowsOf(curves, figure.log_y), {
    labels: ["x", ...labels], series, ...paint(curves),
    customBars: true, fillAlpha: 0.16, connectSeparatedPoints: true,
    xlabel: escaped(figure.x_label), ylabel: escaped(figure.y_label), logscale: figure.log_y,
    axes: { x: { ...axisOptions(figure.log_x), drawGrid: true }, y: { ...axisOptions(figure.log_y), axisLabelWidth: 74 } },
    labelsDiv: legend, legend: "always", legendFormatter: legendText,
    highlightCircleSize: 3, xRangePad: figure.log_x ? 0 : 6, yRangePad: 8, gridLineWidth: 0.6, xLabelHeight: 20, yLabelWidth: 20,
  });
  listenToKeys(host, entry.chart, figure.log_x);
}

function repaint() {
  for (const { chart, curves } of plots) chart.updateOptions(paint(curves));
}

// --- the page -----------------------------------------------------------------------------------

function opening() {
  const { recording } = data;
  const samples = recording.samples.map((count, i) => `${count} of gyro ${data.gyros[i]}`).join(", ");
  return [
    make("h1", {}, "Simulation and measurement" + (data.axis ? ` about ${data.axis}` : "")),
    otherPages(),
    make("p", { class: "soft" }, `${data.log}: ${number(recording.seconds, 5)} s; samples: ${samples}; ` +
      `${recording.with_reference ? "with" : "without"} a reference; ${recording.held_out} held out. ` +
      `Model: ${data.model || "none"}. Configuration: ${data.config}.`),
    headline(),
    make("p", { class: "verdict " + data.verdict }, data.verdict_text + "."),
    gapFigure(),
    make("p", { class: "soft" }, "A nat measures how much less likely a sample is than it should be: a gap of 0.1 makes every sample e^0.1 = 1.1 times less likely than a perfect model would."),
    (recording.parts || []).map((part, i) => make("p", { class: "soft" }, `Recording ${i + 1}: ${stretch(part.from_s, part.to_s)}.`)),
    data.notes.map((note) => make("p", { class: "soft" }, "Note: " + note + ".")),
  ];
}

function rounds() {
  if (data.effects.length === 0) return [];
  const rows = data.effects.map((effect, i) => [
    { number: String(i + 1) }, { number: number(effect.gap_before, 4) }, { number: number(effect.gap_after, 4) },
    gyroName(effect.gyro), kindCell(effect.kind), { number: valueOf(effect) }, { number: effect.p_value > 0 ? number(effect.p_value, 2) : "≈ 0" }, effect.applied ? "yes" : "no", readings(effect) || "–"]);
  return [make("h2", {}, "What was found"),
    table(["round", "gap before", "after", "gyro", "effect", "value ± σ", "p", "in model.toml", "may also be"], rows)];
}

function effectSection(effect, i) {
  const lines = [make("h3", {}, `${i + 1}. ${effectName(effect)}`),
    make("p", { class: "soft" }, `The gyro reads, in addition: ${effect.meaning}.`),
    make("p", {}, make("span", { class: "number" }, valueOf(effect)))];
  if (effect.evidence) lines.push(make("p", {}, sentence(effect.evidence)));
  const band = effect.where.band_hz;
  if (effect.where.to_s > effect.where.from_s) lines.push(make("p", { class: "soft" }, `Seen from ${stretch(effect.where.from_s, effect.where.to_s)}, ` +
    `${number(band[0], 3)} to ${number(band[1], 3)} Hz.`));
  if (effect.ambiguous_with.length > 0) {
    const tell = effect.experiment ? ` To tell them apart: ${effect.experiment.replace(/\.$/, "")}.` : "";
    const standing = effect.applied ? "It was accepted and is applied; its doubt is in σ."
      : "It is not applied: model.toml holds all readings as comments, and --accept gyro=1 or gyro=2 writes one.";
    lines.push(make("p", {}, `This recording cannot tell it from: ${readings(effect)}.${tell} ${standing}`));
  }
  if (effect.figure.curves.length > 0) lines.push(plot(effect.figure));
  return lines;
}

function effects() {
  return data.effects.length === 0 ? [] : [make("h2", {}, "What gave it away"), data.effects.map(effectSection).flat()];
}

function residuals() {
  const drawn = data.figures.map((gyro, i) => [gyro.time, gyro.spectrum, gyro.allan]
    .filter((figure) => figure.curves.length > 0)
    .map((figure) => plot({ ...figure, title: `Gyro ${data.gyros[i]}: ${figure.title}` }))).flat();
  return drawn.length === 0 ? [] : [make("h2", {}, "Measured less predicted"), drawn];
}

function remains() {
  const heading = make("h2", {}, "What remains");
  if (data.unexplained.length === 0) {
    return [heading, make("p", {}, "Nothing that stands out of what the final model's own simulations show.")];
  }
  const rows = data.unexplained.map((rest) => [gyroName(rest.gyro), rest.signature, rest.text, stretch(rest.from_s, rest.to_s)]);
  return [heading, make("p", {}, "No effect of the catalogue accounts for this; nothing was added for it."),
    table(["gyro", "signature", "what is seen", "when"], rows)];
}

function untold() {
  if (data.not_told.length === 0) return [];
  return [make("h2", {}, "What could not be told"),
    make("p", {}, "Whether these effects are there, this recording cannot show; what would show them stands beside."),
    table(["gyro: effect", "why", "what would tell"], data.not_told.map((line) => [line.who, line.why, line.experiment || "–"]))];
}

function provenance() {
  const { version, command, files } = data.provenance;
  const sum = (file) => make("span", { class: "sum" }, file.sha256 || "no regular file");
  return [make("h2", {}, "Where this comes from"),
    make("p", {}, `vgyro ${version}: `, make("code", {}, command)),
    table(["file", "SHA-256", "first stamp"], files.map((file) => [file.path, sum(file), file.began || "–"]))];
}

const GLOSSARY = [
  ["Gap, nats per sample", "How much less likely the recording is under the model than it should be: the negative log-likelihood of a sample, less what " +
    "simulations of the final model score. At a gap of 0.1 every sample is, on the average, e^0.1 = 1.1 times less likely than it could be. Counted on samples that took no part in naming or fitting."],
  ["Floor and band", "Simulations of the final model, scored in the same way, spread around the floor; 95 % of them lie inside the band. A gap inside the band is closed: the recording looks like one of the simulations."],
  ["σ", "Standard error of an estimated number; 95 of 100 true values lie within 2 σ of the estimate. Bars and bands in the plots are 2 σ."],
  ["p", "How often a score as high as this would turn up anywhere in the whole search if nothing were there."],
  ["May also be", "Other effects that would have produced the same recording; nothing is certain between them. The gap counts the likelier one. Neither is in model.toml unless it was accepted."],
  ["Measured less predicted", "The gyro's reading less what the model says it should have read at the rate as far as that is known: from the reference, or else from both gyros together, where only differences between the gyros show."],
  ["Allan deviation", "How far means over a time differ from the next such mean. White noise falls with the square root of the time, drift rises with it."],
];

function glossary() {
  return [make("h2", {}, "What the numbers mean"),
    make("dl", {}, GLOSSARY.map(([term, text]) => [make("dt", {}, term), make("dd", {}, text)]).flat())];
}

document.title = `vgyro gap${data.axis ? ` about ${data.axis}` : ""}: ${data.log}`;
const sections = data.axes ? [axesOpening(), axesEffects(), axesRemains(), axesNotes(), provenance(), glossary()]
  : [opening(), rounds(), effects(), residuals(), remains(), untold(), provenance(), glossary()];
document.getElementById("page").append(...sections.flat(2));
plots.forEach(draw);
let wasNarrow = document.documentElement.clientWidth < NARROW_PX;
window.addEventListener("resize", () => {
  const isNarrow = document.documentElement.clientWidth < NARROW_PX;
  if (isNarrow === wasNarrow || data.axes) return;
  wasNarrow = isNarrow;
  document.getElementById("gap").replaceWith(gapFigure());
});
watchPaper(480); // px of a plot's width, so that a report of two gyros takes four pages
darkness.addEventListener("change", repaint);
