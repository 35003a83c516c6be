"use strict";
// Shared by all pages: nodes, tables, keys of a plot, printing. A user's text goes through
// textContent only.

const data = JSON.parse(document.getElementById("data").textContent);

// --- small helpers ------------------------------------------------------------------------------

function make(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  for (const child of children.flat()) node.append(child);
  return node;
}

function drawing(tag, attributes, text) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

function number(value, digits) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const rounded = Number(value.toPrecision(digits));
  const text = size < 1e-3 || size >= 1e5 ? rounded.toExponential() : String(rounded);
  return text.replace(/^-/, "−").replace("e-", "e−").replace("e+", "e");
}

function escaped(text) {
  const holder = document.createElement("span");
  holder.textContent = text;
  return holder.innerHTML;
}

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
}

// Lets a name of the catalogue break after "_", but not inside a word.
const breakable = (name) => name.split(/(?<=_)/).flatMap((part, i) => (i > 0 ? [make("wbr"), part] : [part]));
const kindCell = (kind) => ({ kind: breakable(kind) });

// A cell is a text, a node, { number } or { kind }.
function tableCell(part, label) {
  const named = { "data-label": label };
  if (typeof part !== "object" || part instanceof Node) return make("td", label ? named : {}, part);
  return "kind" in part ? make("td", { class: "kind", ...named }, part.kind) : make("td", { class: "number", ...named }, part.number);
}

function table(head, rows) {
  return make("div", { class: "scroll" }, make("table", {},
    make("thead", {}, make("tr", {}, head.map((text) => make("th", {}, text)))),
    make("tbody", {}, rows.map((row) => make("tr", {}, row.map((part, i) => tableCell(part, head[i])))))));
}

// --- plots --------------------------------------------------------------------------------------

const plots = []; // each with its host, and its chart once it is drawn

function zoom(chart, factor, shift, log) {
  const scale = log ? Math.log : (v) => v, back = log ? Math.exp : (v) => v;
  const [from, to] = chart.xAxisRange().map(scale);
  const middle = (from + to) / 2 + shift * (to - from), half = ((to - from) / 2) * factor;
  chart.updateOptions({ dateWindow: [back(middle - half), back(middle + half)] });
}

function listenToKeys(host, chart, log) {
  const act = {
    "+": () => zoom(chart, 0.5, 0, log), "-": () => zoom(chart, 2, 0, log),
    ArrowLeft: () => zoom(chart, 1, -0.2, log), ArrowRight: () => zoom(chart, 1, 0.2, log),
    Escape: () => chart.resetZoom(), 0: () => chart.resetZoom(),
  };
  host.addEventListener("keydown", (event) => {
    if (!act[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act[event.key]();
  });
}

// A plot's place on the page.
const framed = (host) => make("div", { class: "frame" }, host);

// A canvas that is drawn anew while the page is being printed stays white, so it is only scaled. Its frame has the scaled
// size and keeps the unscaled width from the browser, which would shrink the whole page to it.
function fitPaper(paperPx) {
  const GROW_MOST = 1.0;
  const sizes = plots.map(({ host }) => [host.offsetWidth, host.offsetHeight]);
  plots.forEach(({ host }, i) => {
    const [wide, high] = sizes[i];
    const scale = Math.min(GROW_MOST, paperPx / wide);
    host.style.cssText = `width: ${wide}px; transform: scale(${scale}); transform-origin: 0 0`;
    host.parentElement.style.cssText = `contain: size; width: ${scale * wide}px; height: ${scale * high}px`;
  });
}

function leavePaper() {
  for (const { host } of plots) host.style.cssText = host.parentElement.style.cssText = "";
}

function watchPaper(paperPx) {
  window.addEventListener("beforeprint", () => fitPaper(paperPx));
  window.addEventListener("afterprint", leavePaper);
}

const darkness = window.matchMedia("(prefers-color-scheme: dark)");
