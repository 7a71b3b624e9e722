// Sliders, each with a field for exact values.
const element = (id) => document.getElementById(id);
// The width available to a drawing. To query it between two changes forces a layout of the page, so it is cached until the size changes.
const rooms = new Map();
const available = (box, most) => {
  if (!rooms.has(box)) rooms.set(box, box.clientWidth);
  return Math.max(280, Math.min(rooms.get(box) || most, most));
};
const clamp = (value, lower, upper) => Math.min(Math.max(value, lower), upper);

// A slider with a field. Arrow keys move it by its own step from the exact value, which need not be a multiple of the step.
const slider = ({ id, label, name, lower, upper, step, get, set }) => {
  const row = document.createElement('div');
  row.className = 'slider';
  row.innerHTML = `<label for="${id}">${inHtml(label)}</label><input type="range" id="${id}" step="any"><input type="number" step="any" id="${id}-exact">`;
  const [, range, exact] = row.children;
  range.setAttribute('aria-label', name);
  exact.setAttribute('aria-label', `${name}, exact value`);
  const show = () => {
    const [low, high] = [lower(), upper()];
    Object.assign(range, { min: Math.min(low, get()), max: Math.max(high, get()), value: get() });
    range.setAttribute('aria-valuetext', short(get()));
    if (document.activeElement !== exact) exact.value = Number(get().toPrecision(10));
  };
  const take = (value) => { if (Number.isFinite(value)) { set(value); changed(); } };
  const rounded = (value) => Number((Math.round(value / step()) * step()).toPrecision(12));
  range.addEventListener('input', () => take(rounded(Number(range.value))));
  range.addEventListener('keydown', (event) => {
    const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    const ends = { Home: Number(range.min), End: Number(range.max) }[event.key];
    if (steps === undefined && ends === undefined) return;
    event.preventDefault();
    take(ends ?? clamp(Number((get() + steps * step()).toPrecision(12)), Number(range.min), Number(range.max)));
  });
  exact.addEventListener('input', () => { if (exact.value !== '') take(Number(exact.value)); });
  show();
  return { row, show };
};

const group = (title, sliders) => {
  const box = document.createElement('fieldset');
  box.innerHTML = `<legend>${inHtml(title)}</legend>`;
  box.append(...sliders.map((s) => s.row));
  return box;
};

const options = (select, list) => { select.innerHTML = list.map(([value, label]) => `<option value="${value}">${escaped(label)}</option>`).join(''); };

// Two fields of an interval.
const intervalFields = (lower, upper, get) => {
  const take = () => {
    const [a, b] = [Number(lower.value), Number(upper.value)];
    if (lower.value !== '' && upper.value !== '' && a < b) { get().range = [a, b]; get().at = clamp(get().at, a, b); changed(); }
  };
  lower.addEventListener('input', take);
  upper.addEventListener('input', take);
  return () => {
    [lower, upper].forEach((field, k) => { if (document.activeElement !== field) field.value = get().range[k]; });
  };
};

const table = (target, head, rows) => {
  const cell = (tag) => (value) => {
    const word = typeof value === 'string';
    return `<${tag}${tag === 'th' ? ' scope="col"' : ''}${word ? ' class="word"' : ''}>${word ? value : shown(value)}</${tag}>`;
  };
  target.innerHTML = rows.length === 0 ? '' : `<thead><tr>${head.map(cell('th')).join('')}</tr></thead><tbody>${rows.map((row) => `<tr>${row.map(cell('td')).join('')}</tr>`).join('')}</tbody>`;
};

const download = (name, text) => {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([text], { type: 'image/svg+xml' }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
const signOf = (det) => (det === null || det === undefined ? '?' : det > 0 ? '+' : det < 0 ? '−' : '0');
const indexSum = (sum) => (sum === null ? 'index sum unknown' : `index sum ${sum > 0 ? '+' : ''}${shown(sum, 0)}`);

// The current point on the curves, chosen by pointer or arrow keys. `pictures` are the drawings, one for each svg in `box`.
const explorer = (box, label, look) => {
  let pictures = [];
  let here = null; // [edge, point]
  const drawCursor = () => {
    [...box.querySelectorAll('svg')].forEach((svg, k) => {
      const cursor = svg.querySelector('.cursor');
      if (!cursor || !pictures[k]) return;
      const point = here && pictures[k].curves[here[0]]?.[here[1]];
      const { X, Y } = pictures[k].frame;
      cursor.innerHTML = point ? `<circle cx="${X(point[0])}" cy="${Y(point[1])}" r="7" fill="none" stroke="currentColor" stroke-width="2.5"/>` : '';
    });
  };
  const go = (edge, k) => { here = edge === null ? null : [edge, k]; drawCursor(); look(here); };
  const nearest = (picture, px, py, from = null) => {
    let best = [Infinity, null];
    picture.curves.forEach((points, e) => points.forEach(([a, b], k) => {
      if (from && e === from) return;
      const far = Math.hypot(picture.frame.X(a) - px, picture.frame.Y(b) - py);
      if (far < best[0]) best = [far, [e, k]];
    }));
    return best;
  };
  const show = (drawn) => {
    pictures = drawn;
    here = null;
    const texts = drawn.map((p) => p.text);
    const svgs = box.querySelectorAll('svg');
    // The elements are reused, so that they keep the focus.
    if (svgs.length !== texts.length) box.innerHTML = texts.join('');
    else {
      const shape = new DOMParser();
      texts.forEach((text, k) => {
        const next = shape.parseFromString(text, 'image/svg+xml').documentElement;
        for (const { name, value } of next.attributes) svgs[k].setAttribute(name, value);
        svgs[k].replaceChildren(...next.childNodes);
      });
    }
    box.querySelectorAll('svg').forEach((svg, k) => {
      svg.setAttribute('tabindex', '0');
      svg.setAttribute('role', 'application');
      svg.setAttribute('aria-label', label(k));
    });
  };
  const pictureOf = (event) => {
    const svg = event.target.closest('svg');
    const k = [...box.querySelectorAll('svg')].indexOf(svg);
    return k < 0 || !pictures[k] ? null : { svg, picture: pictures[k] };
  };
  const pointed = (event) => {
    const found = pictureOf(event);
    if (!found) return;
    const frame = found.svg.getBoundingClientRect();
    const scale = found.svg.viewBox.baseVal.width / frame.width;
    const [far, point] = nearest(found.picture, (event.clientX - frame.left) * scale, (event.clientY - frame.top) * scale);
    if (far < 60) go(...point); else if (here) go(null);
  };
  box.addEventListener('pointermove', pointed);
  box.addEventListener('pointerdown', pointed);
  box.addEventListener('pointerleave', () => here && go(null));
  box.addEventListener('keydown', (event) => {
    const found = pictureOf(event);
    if (!found || !['ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown', 'Escape'].includes(event.key)) return;
    event.preventDefault();
    const { curves, frame } = found.picture;
    if (event.key === 'Escape') { go(null); return; }
    if (!here) { const [, first] = nearest(found.picture, (frame.left + frame.right) / 2, (frame.top + frame.bottom) / 2); if (first) go(...first); return; }
    const [edge, k] = here;
    const [a, b] = curves[edge][k];
    if (event.key === 'ArrowUp' || event.key === 'ArrowDown') {
      // The next curve at about this parameter, upwards or downwards.
      const up = event.key === 'ArrowUp' ? 1 : -1;
      let best = [Infinity, null];
      curves.forEach((points, e) => points.forEach(([u, w], j) => {
        const [dx, dy] = [Math.abs(frame.X(u) - frame.X(a)), up * (frame.Y(b) - frame.Y(w))];
        if (e !== edge && dy > 2 && dx < 40 && dy + 2 * dx < best[0]) best = [dy + 2 * dx, [e, j]];
      }));
      if (best[1]) go(...best[1]);
      return;
    }
    const right = event.key === 'ArrowRight' ? 1 : -1;
    const along = curves[edge].length > 1 && curves[edge][curves[edge].length - 1][0] < curves[edge][0][0] ? -right : right;
    if (curves[edge][k + along]) { go(edge, k + along); return; }
    // Continue on the curve that begins where this one ends.
    const next = curves.findIndex((points, e) => e !== edge && [points[0], points[points.length - 1]].some((end) => end && Math.hypot(end[0] - a, end[1] - b) < 1e-9));
    if (next >= 0) { const last = curves[next].length - 1; go(next, Math.hypot(curves[next][0][0] - a, curves[next][0][1] - b) < 1e-9 ? Math.min(1, last) : Math.max(last - 1, 0)); }
  });
  return { show };
};
