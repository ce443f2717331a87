"use strict";
(async () => {
  const root = document.documentElement, charts = [...document.querySelectorAll(".chart")];
  const PRINT = { width: 345, row: 62, rest: 58 };  // CSS pixels: half an A4 page inside its margins, a row of axes
  const read = name => getComputedStyle(root).getPropertyValue(name).trim();

  // The library and the charts' data travel deflated, as base64. Browsers since 2023 unpack them by themselves.
  const unpacked = async element => {
    const bytes = Uint8Array.from(atob(element.textContent), c => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).text();
  };
  const packed = [...document.querySelectorAll("script[data-packed]")];
  try {
    const texts = await Promise.all(packed.map(unpacked));
    packed.forEach((element, i) => { element.textContent = texts[i]; });
  } catch (error) {
    charts.forEach(place => { place.textContent = `This browser cannot unpack the charts (${error.message}); use one of 2023 or later.`; });
    charts.length = 0;
  }
  const library = document.getElementById("plotly");
  if (library && charts.length) root.appendChild(Object.assign(document.createElement("script"), { text: library.textContent }));

  // Arrays travel as base64 of their little-endian bytes.
  const array = x => {
    const [kind, text] = Object.entries(x)[0];
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
    return kind === "f8" ? new Float64Array(bytes) : new Float32Array(bytes);
  };
  const rgba = (hex, alpha) => `rgba(${[1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16)).join()},${alpha})`;
  // Colours are names; "c0/0.2" is the first one, a fifth opaque.
  const colour = name => {
    const [base, alpha] = name.split("/");
    if (!/^(c\d|ref|ink|paper)$/.test(base)) return name;
    return alpha ? rgba(read("--" + base), alpha) : read("--" + base);
  };
  const resolve = x => {
    if (Array.isArray(x)) return x.map(resolve);
    if (x === null || typeof x !== "object" || ArrayBuffer.isView(x)) return x;
    if ("f4" in x || "f8" in x) return array(x);
    return Object.fromEntries(Object.entries(x).map(([k, v]) =>
      [k, /color$/i.test(k) && typeof v === "string" ? colour(v) : resolve(v)]));
  };
  const dressed = (layout, data, paper) => {
    const named = data.some(trace => trace.name && trace.showlegend !== false);
    const ink = read("--ink"), grid = read("--line");
    const axis = { gridcolor: grid, zerolinecolor: grid, linecolor: grid, exponentformat: "power", automargin: true };
    const size = paper ? 8 : 13, rows = Object.keys(layout).filter(key => key.startsWith("yaxis")).length;
    const found = { ...layout, paper_bgcolor: read("--paper"), plot_bgcolor: read("--paper"),
      font: { family: "system-ui, 'Noto Sans', 'Noto Sans CJK SC', sans-serif", size, color: ink },
      margin: paper ? { l: 40, r: 6, t: 14, b: 26 } : { l: 70, r: 22, t: named ? 58 : 40, b: 50 },  // buttons above the names
      hovermode: layout.hovermode || "x unified", hoverlabel: { bgcolor: read("--paper"), font: { color: ink } },
      legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, itemsizing: "constant", ...(layout.legend || {}) } };
    for (const key of Object.keys(found)) if (/^[xy]axis/.test(key)) {
      const whole = key[0] === "x" ? { exponentformat: "none" } : {};  // a time of the week is 152500, not 1.525 times something
      found[key] = { ...axis, ...whole, ...(found[key].type === "log" ? { tickformat: "~g" } : {}), ...found[key] };  // 0.2, not a small 2
      // With a standoff the title keeps clear of the widest figure, and the margin grows with it.
      if (found[key].title) found[key].title = { ...found[key].title, font: { size }, ...(key[0] === "y" ? { standoff: paper ? 2 : 8 } : {}) };
    }
    if (paper) { found.height = Math.max(190, PRINT.row * rows + PRINT.rest); found.width = PRINT.width; }
    return found;
  };
  const draw = (place, paper = false) => {
    const { data, layout } = JSON.parse(document.getElementById(place.dataset.chart).textContent);
    return Plotly.react(place, resolve(data), resolve(dressed(layout, data, paper)),
      { displaylogo: false, responsive: !paper, modeBarButtonsToRemove: ["toImage", "select2d", "lasso2d"] });
  };
  const drawAll = paper => charts.forEach(place => draw(place, paper));

  const save = (name, type, text) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  };
  // One row a point, as drawn: series, x, y.
  const csv = place => {
    const { data } = JSON.parse(document.getElementById(place.dataset.chart).textContent), rows = ["series,x,y"];
    for (const trace of data.filter(t => t.name)) {
      const x = Array.isArray(trace.x) ? trace.x : array(trace.x), y = array(trace.y), name = `"${trace.name.replaceAll('"', '""')}"`;
      x.forEach((v, i) => rows.push(`${name},${v},${y[i]}`));
    }
    return rows.join("\n") + "\n";
  };
  const table = element => [...element.rows].map(row =>
    [...row.cells].map(cell => `"${cell.innerText.replaceAll('"', '""')}"`).join()).join("\n") + "\n";

  document.querySelectorAll("button[data-save]").forEach(button => button.addEventListener("click", () => {
    const section = button.closest("section"), name = section.id, place = section.querySelector(".chart");
    if (button.dataset.save === "png") Plotly.downloadImage(place, { format: "png", filename: name, scale: 2 });
    else save(`${name}.csv`, "text/csv", place ? csv(place) : table(section.querySelector("table")));
  }));

  const dark = matchMedia("(prefers-color-scheme: dark)"), asked = new URLSearchParams(location.search).get("theme");
  const wear = theme => { root.dataset.theme = theme; if (window.Plotly) drawAll(false); };
  document.getElementById("theme").addEventListener("click", () => wear(root.dataset.theme === "dark" ? "light" : "dark"));
  dark.addEventListener("change", event => wear(event.matches ? "dark" : "light"));
  wear(asked || (dark.matches ? "dark" : "light"));

  let before = null;
  addEventListener("beforeprint", () => { before = root.dataset.theme; root.dataset.theme = "light"; if (window.Plotly) drawAll(true); });
  addEventListener("afterprint", () => wear(before || "light"));
})();
