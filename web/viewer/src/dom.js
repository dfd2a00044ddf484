// Small helpers to make elements without markup in strings: the content security policy allows neither inline style nor script.

/** An element: `el("button.small", { onclick, "aria-label": "…" }, "text", child, …)`. Null children are left out. */
export function el(selector, properties = {}, ...children) {
  const [tag, ...classes] = selector.split(".");
  const element = document.createElement(tag || "div");
  if (classes.length) element.className = classes.join(" ");
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null) continue;
    if (key in element && !key.startsWith("aria-")) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

// 24 × 24, strokes only.
const shapes = {
  point: "M9 18h6M10 21h4M12 3a6 6 0 0 0-3.5 10.9c.6.5 1 1.200 1 2h5c0-.8.4-1.500 1-2A6 6 0 0 0 12 3z",
  spot: "M9 3h6l1 5H8zM8 8 3 20h18L16 8",
  directional: "M12 8a4 4 0 1 0 0 8 4 4 0 0 0 0-8zM12 2v2.500M12 19.500V22M2 12h2.500M19.500 12H22M5 5l1.700 1.700M17.300 17.300 19 19M5 19l1.700-1.700M17.300 6.700 19 5",
  rect: "M4 5h16v6H4zM7 15l-1 4M12 15v5M17 15l1 4",
  disk: "M4 8a8 3.500 0 0 0 16 0 8 3.500 0 0 0-16 0zM7 15l-1 4M12 15v5M17 15l1 4",
  emissive: "M12 3l2.200 6.800L21 12l-6.800 2.200L12 21l-2.200-6.800L3 12l6.800-2.200z",
  sky: "M7 18a4 4 0 1 1 .6-7.950A5.500 5.500 0 0 1 18 11.500 3.300 3.300 0 0 1 17.500 18z",
  combined: "M12 3l9 5-9 5-9-5zM3 12.500l9 5 9-5M3 17l9 5 9-5",
  monitor: "M3 4h18v12H3zM8 20h8M12 16v4",
  reset: "M4 4v6h6M4.600 10A8 8 0 1 1 4 14",
  more: "M6 9l6 6 6-6",
  close: "M5 5l14 14M19 5 5 19",
  panel: "M3 4h18v16H3zM15 4v16",
  camera: "M3 7h4l2-3h6l2 3h4v12H3zM12 9.500a3.500 3.500 0 1 0 0 7 3.500 3.500 0 0 0 0-7z",
  orbit: "M12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM2.500 12c0-2.500 4.300-4.500 9.500-4.500s9.500 2 9.500 4.500-4.300 4.500-9.500 4.500-9.500-2-9.500-4.500z",
  walk: "M13 3.500a1.500 1.500 0 1 0 0 .1M9 21l2-6 3 2v4M11 15l1-6-4 2v3M12 9l3 3h3",
  play: "M7 4l13 8-13 8z",
  pause: "M7 4v16M17 4v16",
  picture: "M3 4h18v16H3zM3 17l5-5 4 4 4-5 5 6M8.500 8.500a1 1 0 1 0 0 .1",
  link: "M10 14a4 4 0 0 0 6 .5l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6-.5l-3 3a4 4 0 0 0 6 6l1-1",
  help: "M9 9a3 3 0 1 1 4.500 2.600c-1 .6-1.500 1.200-1.500 2.400M12 17.500v.5",
};

/** A drawn icon by name; says nothing to screen readers. */
export function icon(name) {
  const ns = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(ns, "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(ns, "path");
  path.setAttribute("d", shapes[name] ?? shapes.emissive);
  svg.append(path);
  return svg;
}

/** A button that shows an icon alone; `label` is its name and tooltip. */
export function iconButton(name, label, onclick, more = "") {
  return el(`button.icon-button${more}`, { type: "button", title: label, "aria-label": label, onclick }, icon(name));
}

/** Radio buttons in a row that look like one control. `choices`: [[value, text, tooltip]…]. */
export function segmented(label, choices, value, onchange) {
  const name = `choice-${Math.random().toString(36).slice(2)}`;
  const inputs = new Map();
  const root = el("div.segmented", { role: "radiogroup", "aria-label": label });
  for (const [key, text, tooltip] of choices) {
    const input = el("input", { type: "radio", name, value: key, checked: key === value, onchange: () => onchange(key) });
    inputs.set(key, input);
    root.append(el("label", { title: tooltip ?? "" }, input, el("span", {}, text)));
  }
  return { root, set: (key) => inputs.has(key) && (inputs.get(key).checked = true) };
}
