// The chart of tree sizes, drawn by plotly, which the studio serves from its own machine.

import { element } from "./dom.js";
import { count, percent } from "./words.js";

let loading = null;
let sized = null;

function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const failed = () => {
      loading = null;
      reject(new Error("the chart could not be loaded"));
    };
    document.head.append(
      element("script", { src: "/plotly.js", load: () => (window.Plotly ? resolve(window.Plotly) : failed()), error: failed }),
    );
  });
  return loading;
}

/**
 * Draws size against agreement, recall and, where trees were let drive, success.
 *
 * @param {HTMLElement} host - Where.
 * @param {object[]} levels - As the studio sends them.
 * @param {number} current - The level in the draft.
 * @param {(number: number) => void} choose - Told which level was pressed.
 */
export async function drawLevels(host, levels, current, choose) {
  const Plotly = await plotly();
  const style = getComputedStyle(host);
  const color = (name) => style.getPropertyValue(name).trim();
  const [ink, faded, rule] = [color("--ink"), color("--faded"), color("--rule")];
  const sorted = [...levels].sort((left, right) => left.leaves - right.leaves);
  const x = sorted.map((level) => level.leaves);
  const line = (name, key, shade, symbol, dash) => ({
    name,
    x,
    y: sorted.map((level) => level[key]),
    customdata: sorted.map((level) => level.number),
    text: sorted.map((level) => `${count(level.leaves, "leaf", "leaves")}: ${name} ${percent(level[key])}`),
    hoverinfo: "text",
    mode: "lines+markers",
    line: { color: shade, width: 2.5, dash },
    marker: { symbol, size: 11, color: shade },
  });
  const marked = (name, level, symbol, shade, size) => ({
    name,
    x: [level.leaves],
    y: [level.agreement],
    customdata: [level.number],
    text: [`${name}: ${count(level.leaves, "leaf", "leaves")}`],
    hoverinfo: "text",
    mode: "markers",
    marker: { symbol, size, color: shade, line: { color: shade, width: 3 } },
  });
  const traces = [
    line("agreement", "agreement", color("--blue"), "circle", "solid"),
    line("recall, mean of all actions", "recall", color("--orange"), "square", "dot"),
  ];
  const drove = sorted.filter((level) => level.drove);
  if (drove.length) traces.push(success(drove, color("--green")));
  const chosen = sorted.find((level) => level.number === current);
  if (chosen && chosen.agreement !== null) traces.push(marked("in your draft", chosen, "circle-open", ink, 24));
  const layout = {
    margin: { l: 54, r: 16, t: 64, b: 48 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: ink, size: 14, family: "system-ui, sans-serif" },
    hovermode: "closest",
    dragmode: false,
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { color: ink } },
    height: 360,
    xaxis: {
      title: { text: "size: leaves of the decision tree", font: { size: 14 } },
      type: x.at(-1) > 50 * Math.max(x[0], 1) ? "log" : "linear",
      gridcolor: rule,
      zeroline: false,
      tickcolor: faded,
      fixedrange: true,
    },
    yaxis: { tickformat: ".0%", gridcolor: rule, zeroline: false, rangemode: "normal", fixedrange: true },
  };
  // Plotly adds to what is there, also to words that say to wait.
  const isNew = !host.classList.contains("js-plotly-plot");
  if (isNew) host.replaceChildren();
  await Plotly[isNew ? "newPlot" : "react"](host, traces, layout, { displayModeBar: false });
  // Plotly hears of the window's size only, not of a section that is shown again.
  sized ??= new ResizeObserver(() => {
    if (host.clientWidth && host.classList.contains("js-plotly-plot")) Plotly.Plots.resize(host);
  });
  sized.observe(host);
  host.removeAllListeners?.("plotly_click");
  host.on("plotly_click", (event) => {
    const [point] = event.points;
    if (point?.customdata !== undefined) choose(point.customdata);
  });
}

/** How often trees succeeded when they drove, each with what so few episodes leave open. */
function success(levels, shade) {
  const shares = levels.map((level) => level.drove.share);
  const ends = levels.map((level) => level.drove.interval);
  return {
    name: "success when driving",
    x: levels.map((level) => level.leaves),
    y: shares,
    customdata: levels.map((level) => level.number),
    text: levels.map((level) => `${count(level.leaves, "leaf", "leaves")}: ${driveWords(level.drove)}`),
    hoverinfo: "text",
    mode: "markers",
    marker: { symbol: "diamond", size: 13, color: shade },
    error_y: {
      type: "data",
      symmetric: false,
      array: ends.map(([, high], place) => high - shares[place]),
      arrayminus: ends.map(([low], place) => shares[place] - low),
      color: shade,
      thickness: 2,
    },
  };
}

/** What a driving trial has found of a tree. */
export function driveWords(drove) {
  return `succeeded in ${drove.successes} of ${count(drove.episodes, "episode")}`;
}
