// Pictures as SVG text: axes, curves, marks and legends. Colours and marks are those of the crate's pictures, which colour-blind readers
// can tell apart; a dark background has other colours, equally far apart (tests/pictures.rs). Pieces beyond `cycle` are grey, like grazing.
const palettes = {
  light: {
    paper: '#ffffff', ink: '#1a1a1a', faint: '#5c6166', grid: '#e3e6ea', body: '#dfe6ee',
    open: '#d55e00', stick: '#1aa873', slip: '#0072b2', grazing: '#555555', fold: '#dd8fbd',
    cycle: ['#0072b2', '#d55e00', '#1aa873', '#dd8fbd', '#ffb000'],
  },
  dark: {
    paper: '#15181c', ink: '#e8eaed', faint: '#a3abb3', grid: '#2a3037', body: '#2c3640',
    open: '#ffaa1f', stick: '#3bf38c', slip: '#50b3ff', grazing: '#787878', fold: '#d9c4d8',
    cycle: ['#50b3ff', '#ffaa1f', '#3bf38c', '#d9c4d8', '#888833'],
  },
};
const font = 'DejaVu Sans, Segoe UI, Roboto, sans-serif';

const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' }[c]));
// Rounding errors are shown as 0, hyphens as minus signs.
const shown = (value, digits = 4) => {
  if (value === null || !Number.isFinite(value)) return '?';
  const size = Math.abs(value);
  if (size !== 0 && size >= 1e6) return value.toExponential(3).replace('-', '−');
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? (0).toFixed(digits) : text).replace('-', '−');
};
const short = (value) => String(Number(value.toPrecision(6))).replace('-', '−');

// u_t1 with its index as a subscript, for HTML and for SVG.
const subscripts = (text, lower) => escaped(text).replace(/([A-Za-zλμθα⁰¹²³])_([A-Za-zν0-9,]+)/g, (_, a, b) => a + lower(b));
const inHtml = (text) => subscripts(text, (b) => `<sub>${b}</sub>`);
const inSvg = (text) => subscripts(text, (b) => `<tspan dy="4" font-size="80%">${b}</tspan><tspan dy="-4">\u200b</tspan>`);

const widthOf = (() => {
  const context = document.createElement('canvas').getContext('2d');
  const known = new Map();
  return (text, size) => {
    const key = `${size} ${text}`;
    if (!known.has(key)) {
      if (known.size > 2000) known.clear();
      context.font = `${size}px ${font}`;
      known.set(key, context.measureText(text.replace('_', '')).width);
    }
    return known.get(key);
  };
})();

const ticks = ([lower, upper], wanted) => {
  const rough = (upper - lower) / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough) ?? 10 * power;
  const list = [];
  for (let k = Math.ceil(lower / step - 1e-9); k * step <= upper + 1e-9 * step; k += 1) list.push(k * step);
  return list;
};

// The range of values, with a margin.
const padded = (values) => {
  let [lower, upper] = [Math.min(...values), Math.max(...values)];
  if (!(upper > lower + 1e-9 * Math.max(1, Math.abs(lower)))) [lower, upper] = [lower - 1, upper + 1];
  const margin = 0.07 * (upper - lower);
  return [lower - margin, upper + margin];
};

// Values taken on a sufficient part of the horizontal axis, and those at events, so that curves that go to infinity do not set the range.
const rangeOf = (curves, events) => {
  const weighted = [];
  for (const points of curves) {
    for (let k = 1; k < points.length; k += 1) {
      const weight = Math.abs(points[k][0] - points[k - 1][0]);
      weighted.push([points[k][1], weight], [points[k - 1][1], weight]);
    }
  }
  weighted.sort((a, b) => a[0] - b[0]);
  const total = weighted.reduce((sum, w) => sum + w[1], 0);
  const at = (share) => {
    let sum = 0;
    for (const [value, weight] of weighted) { sum += weight; if (sum >= share * total) return value; }
    return weighted.length ? weighted[weighted.length - 1][0] : 0;
  };
  const values = [...events];
  if (total > 0) values.push(at(0.004), at(0.996));
  return padded(values.length ? values : [0]);
};

// The name of the mark of a vertex, by its kind.
const events = {
  'pass-through': 'transition', fold: 'fold', 'smooth fold': 'smooth fold', 'vertical segment': 'vertical segment', branching: 'branching',
  'branch point': 'branching', end: 'end', isolated: 'isolated solution', undecided: 'undecided', start: 'start',
};
// Marks as the crate draws them, in the order of legends; 'these data' marks the current values of the sliders.
const marks = {
  transition: (r) => `<circle r="${r}"/>`,
  fold: (r) => `<path d="M0,${-1.25 * r}L${1.15 * r},${0.85 * r}H${-1.15 * r}Z"/>`,
  'smooth fold': (r) => `<path d="M${-0.9 * r},${-0.9 * r}H${0.9 * r}V${0.9 * r}H${-0.9 * r}Z"/>`,
  'vertical segment': (r) => `<path d="M${1.25 * r},0L0,${1.25 * r}L${-1.25 * r},0L0,${-1.25 * r}Z"/>`,
  branching: (r) => `<path d="M${1.25 * r},0L0,${1.25 * r}L${-1.25 * r},0L0,${-1.25 * r}Z"/>`,
  end: (r) => `<path stroke-width="2" d="M${-0.9 * r},${-0.9 * r}L${0.9 * r},${0.9 * r}M${-0.9 * r},${0.9 * r}L${0.9 * r},${-0.9 * r}"/>`,
  'isolated solution': (r) => `<circle r="${0.7 * r}"/>`,
  undecided: (r) => `<circle r="${1.1 * r}"/><path d="M${-0.7 * r},${-0.7 * r}L${0.7 * r},${0.7 * r}M${-0.7 * r},${0.7 * r}L${0.7 * r},${-0.7 * r}"/>`,
  start: (r) => `<path stroke-width="2" d="M0,${-1.3 * r}V${1.3 * r}M${-1.13 * r},${-0.65 * r}L${1.13 * r},${0.65 * r}M${-1.13 * r},${0.65 * r}L${1.13 * r},${-0.65 * r}"/>`,
  value: (r) => `<path d="M${-1.1 * r},0H${1.1 * r}M0,${-1.1 * r}V${1.1 * r}"/>`,
  'these data': (r) => `<path d="M${-1.2 * r},0H${1.2 * r}M0,${-1.2 * r}V${1.2 * r}"/>`,
};
const filled = new Set(['branching', 'isolated solution']);
const mark = (kind, x, y, colours, r = 4.5) => {
  if (!marks[kind]) return '';
  const fill = filled.has(kind) ? colours.ink : colours.paper;
  return `<g transform="translate(${x.toFixed(2)},${y.toFixed(2)})" fill="${fill}" stroke="${colours.ink}" stroke-width="1.5">${marks[kind](r)}</g>`;
};

// Axes of a picture: the maps to positions, and the SVG of frame, ticks and labels.
const axes = ({ width, height, x, y, xLabel, yLabel, title, legend, colours, name }) => {
  const size = 13;
  const rows = [];
  let used = Infinity;
  for (const entry of legend) {
    const room = 44 + widthOf(entry.label, size);
    if (used + room > width - 12) { rows.push([]); used = 0; }
    rows[rows.length - 1].push([entry, used]);
    used += room;
  }
  const yTicks = ticks(y, Math.max(3, height / 70));
  const left = 34 + Math.max(...yTicks.map((v) => widthOf(short(v), size)), 10);
  const [top, right] = [title ? 30 : 14, 14];
  const total = height + rows.length * 22 + 8;
  const bottom = height - 44;
  const X = (v) => left + ((v - x[0]) / (x[1] - x[0])) * (width - right - left);
  const Y = (v) => bottom - ((v - y[0]) / (y[1] - y[0])) * (bottom - top);
  const xTicks = ticks(x, Math.max(3, (width - left) / 80));
  let text = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${total}" viewBox="0 0 ${width} ${total}" font-family="${font}" font-size="${size}">`;
  text += `<title>${escaped(name)}</title><rect width="${width}" height="${total}" fill="${colours.paper}"/>`;
  const clip = `clip-${name.replace(/[^a-z0-9]/gi, '')}-${width}`;
  text += `<clipPath id="${clip}"><rect x="${left}" y="${top}" width="${width - right - left}" height="${bottom - top}"/></clipPath>`;
  text += `<g stroke="${colours.grid}">${xTicks.map((v) => `<path d="M${X(v).toFixed(1)},${top}V${bottom}"/>`).join('')}${yTicks.map((v) => `<path d="M${left},${Y(v).toFixed(1)}H${width - right}"/>`).join('')}</g>`;
  text += `<g fill="${colours.faint}" text-anchor="middle">${xTicks.map((v) => `<text x="${X(v).toFixed(1)}" y="${bottom + 17}">${short(v)}</text>`).join('')}</g>`;
  text += `<g fill="${colours.faint}" text-anchor="end">${yTicks.map((v) => `<text x="${left - 6}" y="${(Y(v) + 4.5).toFixed(1)}">${short(v)}</text>`).join('')}</g>`;
  text += `<g fill="${colours.ink}" text-anchor="middle"><text x="${(left + width - right) / 2}" y="${bottom + 37}">${inSvg(xLabel)}</text>`;
  text += `<text transform="translate(15,${(top + bottom) / 2}) rotate(-90)">${inSvg(yLabel)}</text>`;
  if (title) text += `<text x="${(left + width - right) / 2}" y="19" font-weight="600">${inSvg(title)}</text>`;
  text += '</g>';
  rows.forEach((row, k) => {
    const line = height + 14 + 22 * k;
    for (const [entry, at] of row) {
      const start = 8 + at;
      text += entry.mark
        ? mark(entry.mark, start + 14, line - 4, colours)
        : `<path d="M${start},${line - 4}h26" stroke="${entry.colour}" stroke-width="${entry.width ?? 2.5}"${entry.dash ? ` stroke-dasharray="${entry.dash}"` : ''}/>`;
      text += `<text x="${start + 32}" y="${line}" fill="${colours.ink}">${inSvg(entry.label)}</text>`;
    }
  });
  const frame = `<rect x="${left}" y="${top}" width="${width - right - left}" height="${bottom - top}" fill="none" stroke="${colours.faint}"/>`;
  return { X, Y, text, frame, clip, left, top, right: width - right, bottom };
};

// The path of an edge from point to point: cubics with the tangents of the edge at their ends, as the crate draws them (Curve in its module
// output), lines where the edge is straight. `value` gives the drawn quantity of x; its slope is a one-sided difference quotient.
const pathOf = (edge, first, last, value, X, Y) => {
  const parameter = (x) => x[x.length - 1];
  const at = (x) => [X(parameter(x)), Y(value(x))];
  const pixel = ([a, b]) => `${a.toFixed(2)},${b.toFixed(2)}`;
  const unit = ([a, b]) => [a / Math.hypot(a, b), b / Math.hypot(a, b)];
  const cross = (a, b) => a[0] * b[1] - a[1] * b[0];
  const direction = (x, t, h) => {
    const along = (s) => value(x.map((v, k) => v + s * t[k]));
    const slope = (4 * along(h) - 3 * value(x) - along(2 * h)) / (2 * h);
    return unit([(X(1) - X(0)) * parameter(t), (Y(1) - Y(0)) * slope]);
  };
  let path = `M${pixel(at(edge.points[first]))}`;
  for (let k = first; k < last; k += 1) {
    const [x, z] = [edge.points[k], edge.points[k + 1]];
    const [a, b] = [at(x), at(z)];
    const h = 1e-4 * Math.hypot(...x.map((v, i) => z[i] - v));
    const [u, v] = [direction(x, edge.tangents[k], h), direction(z, edge.tangents[k + 1], -h)];
    const chord = Math.hypot(b[0] - a[0], b[1] - a[1]);
    const c = unit([b[0] - a[0], b[1] - a[1]]);
    // Parabolas are exact: control points at two thirds of the ways to the point where the tangents meet.
    const turn = cross(u, v);
    const [ahead, behind] = [cross(c, v) / turn, cross(u, c) / turn];
    const [from, to] = (ahead > 0 && behind > 0 ? [2 * Math.min(ahead, 1), 2 * Math.min(behind, 1)] : [1, 1]).map((l) => (l * chord) / 3);
    const [p, q] = [[a[0] + from * u[0], a[1] + from * u[1]], [b[0] - to * v[0], b[1] - to * v[1]]];
    const away = (d) => Math.abs(cross([d[0] - a[0], d[1] - a[1]], c));
    path += Math.max(away(p), away(q)) > 0.05 ? `C${pixel(p)} ${pixel(q)} ${pixel(b)}` : `L${pixel(b)}`;
  }
  return path;
};

// A diagram over its parameter. `value` gives the drawn quantity of a point, `style` the class {label, colour} of an edge. `at` is the
// value of the parameter that is marked, with the solutions there.
const diagramPicture = ({ diagram, value, style, range, at, solutions, colours, ...picture }) => {
  const place = (x) => [x[x.length - 1], value(x)];
  const curves = diagram.edges.map((edge) => edge.points.map(place));
  // Starts are not marked: the page chooses them, not the user.
  const marked = diagram.vertices.filter((v) => v.number || v.kind === 'isolated');
  const y = rangeOf(curves, [...marked.map((v) => value(v.x)), ...solutions.map(value)]);

  const runs = [];
  const classes = new Map();
  const kinds = new Set(marked.map((v) => events[v.kind]));
  diagram.edges.forEach((edge, e) => {
    const look = style(edge);
    classes.set(look.label, look);
    const cuts = [0, ...edge.folds, edge.points.length - 1];
    if (edge.folds.length) kinds.add('smooth fold');
    for (let k = 1; k < cuts.length; k += 1) {
      const [from, to] = [cuts[k - 1], cuts[k]];
      runs.push({ edge, from, to, colour: look.colour, negative: edge.det[Math.floor((from + to) / 2)] === -1 });
    }
  });
  const legend = [...classes.values()];
  if (runs.some((run) => run.negative)) legend.push({ label: 'det < 0', colour: colours.faint, dash: '7 4' });
  for (const kind of Object.keys(marks)) if (kinds.has(kind)) legend.push({ label: kind, mark: kind });

  const frame = axes({ ...picture, x: range, y, legend, colours });
  const { X, Y } = frame;
  let text = frame.text;
  text += `<g clip-path="url(#${frame.clip})">`;
  text += `<path d="M${X(at).toFixed(2)},${frame.top}V${frame.bottom}" stroke="${colours.faint}" stroke-dasharray="2 3"/>`;
  text += '<g fill="none" stroke-width="2.5" stroke-linejoin="round">';
  for (const run of runs) text += `<path d="${pathOf(run.edge, run.from, run.to, value, X, Y)}" stroke="${run.colour}"${run.negative ? ' stroke-dasharray="7 4"' : ''}/>`;
  text += '</g>';
  for (const x of solutions) text += `<circle cx="${X(at).toFixed(2)}" cy="${Y(value(x)).toFixed(2)}" r="3" fill="${colours.ink}"/>`;
  diagram.edges.forEach((edge, e) => {
    for (const k of edge.folds) text += mark('smooth fold', X(curves[e][k][0]), Y(curves[e][k][1]), colours);
  });
  for (const v of marked) text += mark(events[v.kind], X(place(v.x)[0]), Y(place(v.x)[1]), colours);
  text += '</g>' + frame.frame;

  // Labels where they do not overlap earlier ones.
  const taken = [];
  for (const v of marked.filter((e) => e.number)) {
    const [px, py] = [X(place(v.x)[0]), Y(place(v.x)[1])];
    if (px < frame.left - 1 || px > frame.right + 1 || py < frame.top - 1 || py > frame.bottom + 1) continue;
    const label = `T${v.number}`;
    const room = widthOf(label, 12);
    const corners = [[8, -8], [8, 18], [-8 - room, -8], [-8 - room, 18], [8, -24], [8, 34], [-8 - room, -24], [-8 - room, 34]];
    const box = ([dx, dy]) => [px + dx, py + dy - 10, px + dx + room, py + dy + 2];
    const free = (b) => b[0] > frame.left && b[2] < frame.right && b[1] > frame.top && b[3] < frame.bottom
      && taken.every((t) => b[0] > t[2] || t[0] > b[2] || b[1] > t[3] || t[1] > b[3])
      && curves.every((points) => points.every(([u, w]) => !(X(u) > b[0] && X(u) < b[2] && Y(w) > b[1] && Y(w) < b[3])));
    const fits = corners.find((c) => free(box(c))) ?? corners[0];
    taken.push(box(fits));
    text += `<text x="${(px + fits[0]).toFixed(1)}" y="${(py + fits[1]).toFixed(1)}" font-size="12" fill="${colours.ink}" stroke="${colours.paper}" stroke-width="3" paint-order="stroke">${label}</text>`;
  }
  text += '<g class="cursor"></g></svg>';
  return { text, frame, curves };
};
