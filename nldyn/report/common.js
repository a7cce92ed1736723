// what all pages share: their data, axes, units, and tables that are sorted and saved
const find = (name) => document.getElementById(name);
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const stream = new Blob([bytes(find("data").textContent)]).stream().pipeThrough(new DecompressionStream("gzip"));
const data = await new Response(stream).json();
const floats = (text) => new Float32Array(bytes(text));
const SYMBOLS = { LP: "circle-open", PD: "square-open", NS: "diamond-open", BP: "triangle-up-open", GR: "x-thin", CS: "triangle-left-open", GS: "pentagon-open", AS: "triangle-right-open", "phase resonance": "cross-open", "amplitude antiresonance": "triangle-down-open" };
const BLUE = "#0072B2", ORANGE = "#D55E00", GREY = "#555";
const PALETTE = [ORANGE, "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#5D4E9C"];
const FONT = { family: 'system-ui, "DejaVu Sans", sans-serif', size: 12, color: "#202020" };
const LINE = { showline: true, linecolor: "#888", mirror: true, ticks: "outside", gridcolor: "#eee", zerolinecolor: "#bbb" };
const axis = (text, more) => ({ ...LINE, title: { text, standoff: 6 }, ...more });
const NARROW = innerWidth < 700; // of a telephone: no room for the bar of buttons beside a title
const FLAT = [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]];
const config = (name, buttons = FLAT) => ({ responsive: true, displaylogo: false, scrollZoom: false,
  modeBarButtons: buttons, displayModeBar: NARROW ? false : "hover", toImageButtonOptions: { filename: name, scale: 2 } });
function digits(value, count = 6) {
  if (value === null || value === undefined) return "";
  if (Number.isInteger(value) && Math.abs(value) < 1e9) return String(value);
  const short = Number(value.toPrecision(count)), size = Math.abs(short);
  return size >= 1e-3 && size < 1e9 ? String(short) : short.toExponential().replace("e+", "e");
}
const LENGTHS = [[1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]].map(([factor, prefix]) => [factor, prefix + (data.angle ? "rad" : "m")]);
const FORCES = [[1e6, "MN"], [1e3, "kN"], [1, "N"], [1e-3, "mN"], [1e-6, "µN"]];
const most = (values) => values.reduce((found, value) => Math.max(found, Math.abs(value)), 0);
function unitOf(largest, units, share = 1) {
  return units.find(([factor]) => largest >= share * factor) || (largest > 0 ? units[units.length - 1] : units.find(([f]) => f === 1));
}
const lengthUnit = (largest) => unitOf(largest, LENGTHS, 0.5);
const scaled = (values, factor) => Array.from(values, (value) => value / factor);

function element(kind, text, attributes = {}) {
  const made = document.createElement(kind);
  if (text !== undefined) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

const small = (title, x, y, more) => ({ font: FONT, margin: { l: 65, r: 14, t: 30, b: 44 }, title: { text: title, font: { size: 13 }, x: 0.02, xanchor: "left" },
  xaxis: x, yaxis: y, hovermode: "closest", hoverlabel: { bgcolor: "white", font: FONT }, legend: { x: 0.99, y: 0.99, xanchor: "right", bgcolor: "rgba(255,255,255,0.75)" }, ...more });

// --- tables --------------------------------------------------------------------------------------

const SHOWN_ROWS = 400;
const words = (column) => column.replace(/_(hz|m|rad|n_s|n|s|deg|m\/s)$/, (_, unit) => ` (${{ hz: "Hz", n: "N", n_s: "N s" }[unit] ?? unit})`).replaceAll("_", " ");
function csv(table) {
  const cell = (value) => value === null ? "" : /[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value);
  return [table.columns, ...table.rows].map((row) => row.map(cell).join(",")).join("\n") + "\n";
}
function download(table, name) {
  const link = element("a", "", { href: URL.createObjectURL(new Blob([csv(table)], { type: "text/csv" })), download: `${name}.csv` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
function sortable(table, name, orbitOf) {
  const numeric = table.columns.map((_, k) => table.rows.every((row) => row[k] === null || typeof row[k] === "number"));
  const holder = element("div"), box = element("div", undefined, { class: "scroll" }), made = element("table", undefined, { "data-name": name });
  const head = element("tr"), body = element("tbody");
  let by = -1, down = false, rows = table.rows.map((row, i) => [row, i]);
  const fill = () => {
    body.replaceChildren(...rows.slice(0, SHOWN_ROWS).map(([row, i]) => {
      const line = element("tr");
      row.forEach((value, k) => {
        const text = typeof value === "number" ? digits(value, NARROW ? 5 : 8) : value === null ? "" : String(value);
        line.append(element("td", text, { class: numeric[k] ? "number" : text.length > 60 ? "long" : "" }));
      });
      if (orbitOf) {
        line.dataset.orbit = "";
        line.addEventListener("click", () => orbitOf(i));
      }
      return line;
    }));
  };
  const sort = (k) => {
    down = by === k && !down;
    by = k;
    rows.sort(([a, i], [b, j]) => {
      if (a[k] === null || b[k] === null) return (a[k] === null) - (b[k] === null) || i - j;
      const order = numeric[k] ? a[k] - b[k] : String(a[k]).localeCompare(String(b[k]));
      return (down ? -order : order) || i - j;
    });
    [...head.children].forEach((cell, m) => {
      cell.textContent = words(table.columns[m]) + (m === k ? (down ? " ▼" : " ▲") : "");
      cell.setAttribute("aria-sort", m === k ? (down ? "descending" : "ascending") : "none");
    });
    fill();
  };
  table.columns.forEach((column, k) => {
    const cell = element("th", words(column), { class: numeric[k] ? "number" : "", tabindex: "0", title: "sort" });
    cell.addEventListener("click", () => sort(k));
    cell.addEventListener("keydown", (event) => { if (event.key === "Enter") sort(k); });
    head.append(cell);
  });
  const top = element("thead");
  top.append(head);
  made.append(top, body);
  fill();
  box.append(made);
  const save = element("button", "download CSV", { type: "button", "data-csv": name });
  save.addEventListener("click", () => download({ columns: table.columns, rows: rows.map(([row]) => row) }, name));
  const bar = element("div", undefined, { class: "bar" });
  bar.append(save);
  if (rows.length > SHOWN_ROWS) bar.append(element("span", `the first ${SHOWN_ROWS} of ${rows.length} rows are shown; the CSV file has all`, { class: "hint" }));
  holder.append(box, bar);
  return holder;
}
function showTables(orbitOf = {}) {
  const names = Object.keys(data.tables);
  const open = (name) => {
    for (const button of find("tabs").children) button.setAttribute("aria-pressed", String(button.dataset.tab === name));
    find("table").replaceChildren(sortable(data.tables[name], name.replaceAll(" ", "_"), orbitOf[name]));
  };
  for (const name of names) {
    const button = element("button", `${name} (${data.tables[name].rows.length})`, { type: "button", "data-tab": name });
    button.addEventListener("click", () => open(name));
    find("tabs").append(button);
  }
  open(names[0]);
  find("versions").append(sortable({ columns: ["package", "version"], rows: data.versions }, "versions"));
}
