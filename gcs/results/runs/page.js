"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const table = document.getElementById("runs");
const body = table.tBodies[0];
const rows = [...body.rows];
const headings = [...table.querySelectorAll("th[data-column]")];
const first = headings.length ? headings[0].cellIndex : 0;
const columns = headings.map((heading) => heading.dataset.column);
const colours = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f",
                 "#a6761d"];

function make(kind, text, attributes) {
  const element = document.createElement(kind);
  element.textContent = text;
  Object.assign(element, attributes || {});
  return element;
}

function draw(kind, parent, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

// the table

function valueOf(row, column) {
  const cell = row.cells[column];
  if ("value" in cell.dataset) return Number(cell.dataset.value);
  return cell.textContent === "" ? null : cell.textContent;
}

function compareValues(a, b) {
  if (typeof a === "number" && typeof b === "number") return a - b;
  return String(a).localeCompare(String(b), undefined, { numeric: true });
}

function sortBy(heading) {
  const downwards = heading.getAttribute("aria-sort") === "ascending";
  for (const other of headings) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", downwards ? "descending" : "ascending");
  const known = [], unknown = []; // what has no value comes last, either way
  for (const row of rows) {
    const value = valueOf(row, heading.cellIndex);
    if (value === null) unknown.push(row); else known.push([value, row]);
  }
  known.sort((a, b) => (downwards ? -1 : 1) * compareValues(a[0], b[0]));
  body.append(...known.map((entry) => entry[1]), ...unknown);
}

function search() {
  const words = document.getElementById("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0;
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    row.hidden = !words.every((word) => text.includes(word));
    shown += row.hidden ? 0 : 1;
  }
  document.getElementById("shown").textContent =
    words.length ? `${shown} of ${rows.length} runs` : "";
}

// the comparison

const boxOf = (row) => row.cells[0].firstElementChild;

function compare() {
  const chosen = rows.filter((row) => boxOf(row).checked);
  for (const row of rows) row.classList.toggle("marked", boxOf(row).checked);
  document.getElementById("comparison").hidden = chosen.length === 0;
  showLegend(chosen);
  showCharts(chosen);
  showDifferences(chosen);
}

function showLegend(chosen) {
  const legend = document.getElementById("legend");
  legend.replaceChildren();
  chosen.forEach((row, k) => {
    const entry = make("span", "");
    const line = make("i", "");
    line.style.borderColor = colours[k % colours.length];
    entry.append(line, row.dataset.name);
    legend.append(entry);
  });
}

function showCharts(chosen) {
  const charts = document.getElementById("charts");
  charts.replaceChildren();
  const flown = chosen.map((row, k) => {
    const details = data.runs[row.dataset.name];
    return { name: row.dataset.name, curves: details && details.curves, k };
  });
  const known = flown.filter((one) => one.curves);
  if (known.length) {
    for (const [panel, title] of Object.entries(data.panels)) charts.append(chart(panel, title, known));
  }
  const without = flown.filter((one) => !one.curves).map((one) => one.name);
  if (without.length) charts.append(make("p", `no curves of ${without.join(", ")}`));
}

function chart(panel, title, flown) {
  const figure = make("figure", "");
  figure.append(make("figcaption", title));
  const [width, height, left, bottom] = [420, 190, 48, 24];
  const svg = draw("svg", figure, { width, height, viewBox: `0 0 ${width} ${height}`, role: "img",
                                    "aria-label": title });
  const end = Math.max(...flown.map((one) => one.curves.end_s)) || 1;
  const values = flown.flatMap((one) => one.curves[panel]).filter((value) => value !== null);
  const top = Math.max(...values, 0) || 1;
  const x = (t) => left + (t / end) * (width - left - 8);
  const y = (value) => height - bottom - (value / top) * (height - bottom - 10);
  for (const value of ticks(top)) {
    draw("line", svg, { x1: left, x2: width - 8, y1: y(value), y2: y(value) });
    draw("text", svg, { x: left - 4, y: y(value) + 4, "text-anchor": "end" }, value);
  }
  for (const t of ticks(end)) {
    draw("text", svg, { x: x(t), y: height - 8, "text-anchor": "middle" }, t === 0 ? "0 s" : t);
  }
  for (const one of flown) {
    const series = one.curves[panel];
    const steps = series.map((value, i) => [((i + 1) / series.length) * one.curves.end_s, value]);
    const points = steps.filter((step) => step[1] !== null)
      .map((step) => `${x(step[0]).toFixed(1)},${y(step[1]).toFixed(1)}`).join(" ");
    const line = draw("polyline", svg, { points, stroke: colours[one.k % colours.length] });
    draw("title", line, {}, one.name);
  }
  return figure;
}

function ticks(top) {
  const rough = top / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const found = [];
  for (let k = 0; k * step <= top * (1 + 1e-9); k += 1) found.push(Number((k * step).toPrecision(6)));
  return found;
}

function showDifferences(chosen) {
  const shown = document.getElementById("differences");
  shown.replaceChildren();
  if (chosen.length < 2) {
    shown.append(make("caption", "mark another run to see what differs"));
    return;
  }
  const head = shown.createTHead().insertRow();
  head.append(make("th", "differs"), ...chosen.map((row) => make("th", row.dataset.name)));
  const two = chosen.length === 2;
  if (two) head.append(make("th", "second − first"));
  const inside = shown.createTBody();
  let marked = false;
  const add = (name, texts, values, beaten) => {
    if (texts.every((text) => text === texts[0])) return;
    const row = inside.insertRow();
    row.append(make("th", name));
    texts.forEach((text, k) => {
      const kind = typeof values[k] === "number" ? "number" : "";
      const worse = Boolean(beaten && beaten[k] && text);
      marked = marked || worse;
      row.append(make("td", worse ? `${text}*` : text,
                      { className: worse ? `${kind} beaten` : kind }));
    });
    if (!two) return;
    const [a, b] = values;
    const both = typeof a === "number" && typeof b === "number";
    const whole = Number.isInteger(a) && Number.isInteger(b);
    const change = both ? (whole ? b - a : Number((b - a).toPrecision(4))) : "";
    row.append(make("td", change, { className: "number" }));
  };
  columns.forEach((column, k) => {
    if (column === "run" || column === "time") return;
    const cells = chosen.map((row) => row.cells[first + k]);
    const beaten = chosen.map((row) => isBeaten(row.dataset.name, column, chosen));
    const values = chosen.map((row) => valueOf(row, first + k));
    add(column, cells.map((cell) => cell.textContent), values, beaten);
  });
  const details = chosen.map((row) => data.runs[row.dataset.name]);
  const named = new Set(details.flatMap((one) => Object.keys((one && one.keys) || {})));
  for (const name of [...named].sort()) {
    const texts = details.map((one) => {
      if (!one || !one.has_keys) return "unknown";
      return name in one.keys ? one.keys[name] : data.common[name];
    });
    add(name, texts, texts.map((text) => (text === "" || isNaN(text) ? null : Number(text))));
  }
  if (!inside.rows.length) shown.append(make("caption", "nothing differs"));
  else if (marked) shown.append(make("caption", data.legend));
}

function isBeaten(name, column, chosen) {
  const better = ((data.beaten[name] || {})[column]) || [];
  return chosen.some((row) => better.includes(row.dataset.name));
}

for (const heading of headings) {
  heading.firstElementChild.addEventListener("click", () => sortBy(heading));
}
const outcome = first + columns.indexOf("outcome");
for (const row of rows) {
  row.cells[outcome].classList.add("outcome");
  boxOf(row).checked = data.compared.includes(row.dataset.name);
}
body.addEventListener("change", compare);
document.getElementById("search").addEventListener("input", search);
document.getElementById("clear").addEventListener("click", () => {
  for (const row of rows) boxOf(row).checked = false;
  compare();
});
compare();
