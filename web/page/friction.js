// The two tabs with contact nodes.
const frictionTab = (() => {
  const words = { open: 'no contact', stick: 'stick', 'slip+': 'slip +', 'slip-': 'slip −', grazing: 'grazing' };
  const colourOf = (piece, colours) => colours[piece.startsWith('slip') ? 'slip' : piece];
  const said = (pieces) => pieces.map((p) => words[p] ?? p).join(', ');
  let current = null; // { data, problem, diagram, solutions, chosen }
  let planeKey = '';
  let planeLines = null;
  let hovered = null;

  const nodes = (s) => s.load.length / 2;
  const index = (s, k) => (nodes(s) === 1 ? '' : String(k + 1));
  const component = (s, k) => `f_${k % 2 ? 't' : 'ν'}${index(s, Math.floor(k / 2))}`;
  const parameterName = (s) => (s.mode === 'F' ? 'F = α' : 'α');

  const problemOf = (s) => {
    const p = nodes(s);
    const weights = p === 1 ? [1] : [1, s.ratio];
    return s.mode === 'F'
      ? { lambda: s.lambda, mu: s.mu, load: s.load, rate: zeros(2 * p), friction: zeros(p), friction_rate: weights, range: s.range }
      : { lambda: s.lambda, mu: s.mu, load: s.load, rate: s.rate, friction: s.F, friction_rate: zeros(p), range: s.range };
  };
  // x = (u, λν, λt, α) of a node.
  const quantities = {
    ut: [(p, k) => 2 * k + 1, 'u_t'], un: [(p, k) => 2 * k, 'u_ν'], ln: [(p, k) => 2 * p + k, 'λ_ν'], lt: [(p, k) => 3 * p + k, 'λ_t'],
  };

  let shownSliders = [];
  let shownKind = '';
  // Replaces the sliders if others are needed.
  const sliders = () => {
    const s = state[state.tab];
    const kind = `${state.tab} ${s.mode}`;
    if (kind !== shownKind) {
      shownKind = kind;
      planeLines = null;
      const get = () => state[state.tab];
      const make = (id, label, name, [lower, upper], step, read, write) =>
        slider({ id, label, name, lower: () => lower, upper: () => upper, step: () => step, get: read, set: write });
      const at = slider({
        id: 'at', label: parameterName(s), name: s.mode === 'F' ? 'coefficient of friction F' : 'load parameter α',
        lower: () => get().range[0], upper: () => get().range[1], step: () => 0.05,
        get: () => get().at, set: (v) => { get().at = clamp(v, ...get().range); },
      });
      const load = s.load.map((_, k) => make(`load-${k}`, component(s, k), `load ${component(s, k)}`, [-8, 8], 0.05, () => get().load[k], (v) => { get().load[k] = clamp(v, -1e5, 1e5); }));
      const lame = [['lambda', 'λ'], ['mu', 'μ']].map(([key, name]) => make(key, name, `Lamé coefficient ${name}`, [0.05, 6], 0.05, () => get()[key], (v) => { get()[key] = clamp(v, 0.001, 1e5); }));
      const boxes = [group(s.mode === 'F' ? 'Friction' : 'Load parameter', [at]), group(s.mode === 'F' ? 'Load f' : 'Load f⁰', load)];
      const all = [at, ...load, ...lame];
      if (s.mode === 'load') {
        const rate = s.rate.map((_, k) => make(`rate-${k}`, component(s, k), `rate of load ${component(s, k)}`, [-3, 3], 0.05, () => get().rate[k], (v) => { get().rate[k] = clamp(v, -1e5, 1e5); }));
        const coefficients = s.F.map((_, k) => make(`F-${k}`, `F_${index(s, k)}`.replace(/_$/, ''), `coefficient of friction F ${index(s, k)}`, [0, 10], 0.05, () => get().F[k], (v) => { get().F[k] = clamp(v, -100, 1e4); }));
        boxes.push(group('Rate of the load f¹', rate), group('Friction', coefficients));
        all.push(...rate, ...coefficients);
      } else if (nodes(s) === 2) {
        const ratio = make('ratio', 'F_2/F_1', 'friction of node 2 relative to node 1', [0, 4], 0.05, () => get().ratio, (v) => { get().ratio = clamp(v, 0, 100); });
        boxes[0].append(ratio.row);
        all.push(ratio);
      }
      boxes.push(group('Stiffness', lame));
      element('sliders').replaceChildren(...boxes);
      options(element('plane'), s.load.map((_, k) => [k, `${k % 2 ? 'tangential' : 'normal'} load${nodes(s) === 1 ? '' : `, node ${Math.floor(k / 2) + 1}`}`]));
      options(element('example'), [...examples[state.tab].map(([name], k) => [k, name]), ['', 'data of your own']]);
      shownSliders = all;
    }
    shownSliders.forEach((one) => one.show());
    const s2 = state[state.tab];
    const example = exampleOf(state.tab);
    element('told').textContent = toldOf(state.tab);
    element('example').value = example < 0 ? '' : String(example);
    element('mode').value = s2.mode;
    element('quantity').value = s2.quantity;
    element('plane').value = String(s2.plane);
    element('plane-choice').hidden = s2.mode === 'load';
    showRange();
  };

  const pictures = (colours, width) => {
    const { s, diagram, solutions } = current;
    const [place, letter] = quantities[s.quantity];
    const p = nodes(s);
    return Array.from({ length: p }, (_, k) => diagramPicture({
      diagram, colours, range: s.range, at: s.at, solutions: solutions.solutions.map((one) => one.x),
      value: (x) => x[place(p, k)],
      style: (edge) => {
        const piece = edge.pieces[k];
        return { label: piece.startsWith('slip') ? 'slip' : words[piece], colour: colourOf(piece, colours) };
      },
      width, height: 380, xLabel: s.mode === 'F' ? 'F = α' : 'α', yLabel: `${letter}${index(s, k)}`,
      title: p === 1 ? '' : `node ${k + 1}`, name: `Branches of solutions: ${letter}${index(s, k)} over α`,
    }));
  };

  // The body: node 1 left of node 2, or one node; the other corners are clamped.
  const body = () => {
    const { s, scale } = current;
    const colours = colour();
    const point = hovered ?? current.solutions.solutions[current.chosen];
    const p = nodes(s);
    const contact = p === 1 ? [[0, 0]] : [[-1, 0], [0, 0]];
    const triangles = p === 1 ? [[0, 1, 2]] : [[0, 1, 3], [1, 2, 3]];
    const corners = [...contact, [1, 0], [0, 1]];
    const width = available(element('body'), 420);
    const lowest = p === 1 ? -0.65 : -1.65;
    const zoom = (width - 20) / (1.6 - lowest);
    const height = Math.round(1.75 * zoom + 26);
    const X = (v) => 10 + (v - lowest) * zoom;
    const Y = (v) => height - 0.5 * zoom - v * zoom;
    const path = (list) => triangles.map((t) => `M${t.map((c) => `${X(list[c][0]).toFixed(1)},${Y(list[c][1]).toFixed(1)}`).join('L')}Z`).join('');
    let text = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" font-family="${font}" font-size="13" role="img">`;
    let told = 'no solution';
    text += `<rect width="${width}" height="${height}" fill="${colours.paper}"/>`;
    text += `<path d="M0,${Y(0)}H${width}" stroke="${colours.ink}"/><path d="${Array.from({ length: Math.ceil(width / 12) }, (_, k) => `M${12 * k},${Y(0) + 9}l9,-9`).join('')}" stroke="${colours.faint}"/>`;
    text += `<path d="${path(corners)}" fill="none" stroke="${colours.faint}" stroke-dasharray="4 4"/>`;
    if (point) {
      const moved = corners.map(([a, b], k) => (k < p ? [a + scale * point.x[2 * k + 1], b - scale * point.x[2 * k]] : [a, b]));
      text += `<path d="${path(moved)}" fill="${colours.body}" fill-opacity="0.85" stroke="${colours.ink}" stroke-width="1.5" stroke-linejoin="round"/>`;
      text += `<path d="M${X(1)},${Y(0)}L${X(0)},${Y(1)}" stroke="${colours.ink}" stroke-width="5"/>`;
      const largest = Math.max(1e-12, ...contact.map((_, k) => Math.hypot(point.x[2 * p + k], point.x[3 * p + k])));
      for (let k = 0; k < p; k += 1) {
        const [a, b] = [X(moved[k][0]), Y(moved[k][1])];
        const [pressure, traction] = [point.x[2 * p + k], point.x[3 * p + k]];
        const size = (0.42 * zoom) / largest;
        // Forces of the foundation on the body: λν upwards, λt against ut.
        const [da, db] = [-traction * size, -pressure * size];
        if (Math.hypot(da, db) > 3) {
          const angle = Math.atan2(db, da);
          const head = [2.6, -2.6].map((turn) => `L${(a + 9 * Math.cos(angle + turn)).toFixed(1)},${(b + 9 * Math.sin(angle + turn)).toFixed(1)}M${a.toFixed(1)},${b.toFixed(1)}`).join('');
          text += `<path d="M${(a - da).toFixed(1)},${(b - db).toFixed(1)}L${a.toFixed(1)},${b.toFixed(1)}${head}" stroke="${colours.ink}" stroke-width="2" fill="none"/>`;
        }
        text += `<circle cx="${a.toFixed(1)}" cy="${b.toFixed(1)}" r="7" fill="${colourOf(point.pieces[k], colours)}" stroke="${colours.ink}"/>`;
        if (p === 2) text += `<text x="${X(contact[k][0])}" y="${Y(0) + 26}" text-anchor="middle" fill="${colours.ink}">node ${k + 1}</text>`;
      }
      told = said(point.pieces);
    }
    text += `<text x="${width - 8}" y="16" text-anchor="end" fill="${colours.faint}">displacements × ${short(scale)}</text></svg>`;
    element('body').innerHTML = text;
    element('body').firstChild.setAttribute('aria-label', `Deformed body: ${told}`);
  };

  const nodeWords = (s, at) => at.pieces.map((piece, k) => {
    const [p, x] = [nodes(s), at.x];
    const values = [['u_ν', x[2 * k]], ['u_t', x[2 * k + 1]], ['λ_ν', x[2 * p + k]], ['λ_t', x[3 * p + k]]].map(([name, v]) => `${inHtml(name)} ${shown(v)}`);
    const theta = at.theta ? at.theta[k].map((v, t) => `θ${'¹²³'[t]} ${shown(v)}`).join(', ') : '';
    return `${p === 1 ? '' : `node ${k + 1}: `}<strong>${words[piece] ?? piece}</strong>, ${values.join(', ')}${theta ? `; ${theta}` : ''}`;
  }).join('<br>');

  const look = (here) => {
    const { s, diagram, problem } = current;
    hovered = null;
    if (here) {
      const edge = diagram.edges[here[0]];
      const x = edge.points[here[1]];
      const answer = computations.ask({ ask: 'point', problem, x });
      hovered = { x, pieces: edge.pieces, theta: answer.ok?.theta };
      element('here').innerHTML = `α = ${shown(x[x.length - 1])}, det ${signOf(edge.det[here[1]])}<br>${nodeWords(s, hovered)}`;
    } else showChosen();
    body();
  };
  const showChosen = () => {
    const { s, solutions, chosen } = current;
    const one = solutions.solutions[chosen];
    element('here').innerHTML = one ? `Solution ${chosen + 1} at α = ${shown(s.at)}, det ${signOf(one.det[0])}<br>${nodeWords(s, one)}` : `No isolated solution at α = ${shown(s.at)}`;
  };
  const explore = explorer(element('branches'), (k) => `Branches of solutions${nodes(state[state.tab]) === 1 ? '' : `, node ${k + 1}`}: arrow keys move along them`, look);

  // The plane of a load and friction. The lines do not depend on the current point.
  const planeOf = (s) => {
    const p = nodes(s);
    const weights = s.mode === 'F' ? (p === 1 ? [1] : [1, s.ratio]) : s.F.map((f) => (s.F[0] === 0 ? 1 : f / s.F[0]));
    const loads = s.mode === 'F' ? [-8, 8] : s.range;
    const friction = s.mode === 'F' ? [Math.max(0, s.range[0]), Math.max(1, s.range[1])] : [0, Math.max(10, 1.2 * s.F[0])];
    return {
      lambda: s.lambda, mu: s.mu, weights, load: loads, friction,
      base: s.mode === 'F' ? s.load.map((f, k) => (k === s.plane ? 0 : f)) : s.load,
      direction: s.mode === 'F' ? s.load.map((_, k) => (k === s.plane ? 1 : 0)) : s.rate,
    };
  };
  const planePoint = (s) => (s.mode === 'F' ? [s.load[s.plane], s.at] : [s.at, s.F[0]]);
  let planeFrame = null;
  const planePicture = (colours, width) => {
    const { s } = current;
    const plane = planeOf(s);
    const looks = [
      [{ label: 'fold', colour: colours.fold, width: 4 }, (line, k) => line.folds[k] === true],
      [{ label: 'contact begins or ends', colour: colours.open, width: 2.5 }, (line, k) => line.folds[k] !== true && line.test === 0],
      [{ label: 'stick and slip', colour: colours.stick, width: 2.5 }, (line, k) => line.folds[k] !== true && line.test !== 0],
    ];
    const lines = planeLines?.lines ?? [];
    const used = looks.filter(([, is]) => lines.some((line) => line.folds.some((_, k) => is(line, k))));
    const legend = used.map(([entry]) => entry);
    if (lines.some((line) => line.node === 1)) legend.push({ label: 'node 2', colour: colours.faint, dash: '3 3' });
    legend.push({ label: 'these data', mark: 'these data' });
    const xLabel = s.mode === 'F' ? component(s, s.plane) : 'α';
    const frame = axes({
      width, height: 340, x: plane.load, y: plane.friction, xLabel, yLabel: nodes(s) === 1 ? 'F' : 'F_1', title: '', legend, colours,
      name: `Transition set in the plane of ${xLabel} and F`,
    });
    planeFrame = frame;
    let text = `${frame.text}<g clip-path="url(#${frame.clip})" fill="none" stroke-linejoin="round">`;
    for (const [entry, is] of looks) {
      for (const line of lines) {
        let path = '';
        let open = false;
        line.folds.forEach((_, k) => {
          if (!is(line, k)) { open = false; return; }
          const [a, b] = [line.points[k], line.points[k + 1]].map(([u, w]) => `${frame.X(u).toFixed(2)},${frame.Y(w).toFixed(2)}`);
          path += open ? `L${b}` : `M${a}L${b}`;
          open = true;
        });
        if (path) text += `<path d="${path}" stroke="${entry.colour}" stroke-width="${entry.width}"${line.node === 1 ? ' stroke-dasharray="3 3"' : ''}/>`;
      }
    }
    const [a, b] = planePoint(s);
    text += mark('these data', frame.X(a), frame.Y(b), colours, 6) + `<circle cx="${frame.X(a).toFixed(2)}" cy="${frame.Y(b).toFixed(2)}" r="9" stroke="${colours.ink}" stroke-width="2"/>`;
    return `${text}</g>${frame.frame}</svg>`;
  };
  const drawPlane = () => {
    const { s } = current;
    const box = element('plane-drawing');
    box.innerHTML = planePicture(colour(), available(box, 640));
    box.firstChild.setAttribute('role', 'img');
    box.firstChild.setAttribute('aria-label', `Transition set; these data are at ${planePoint(s).map((v) => shown(v)).join(', ')}`);
  };
  // The lines take longer than a frame: they are computed when the slider rests, and only if more than the point has changed.
  let later = 0;
  const showPlane = () => {
    clearTimeout(later);
    const plane = planeOf(current.s);
    const key = JSON.stringify(plane);
    if (key !== planeKey) {
      const find = () => {
        const answer = computations.ask({ ask: 'transition_set', plane });
        planeKey = key;
        planeLines = answer.ok ?? null;
        const notes = answer.error ? [answer.error.message] : answer.ok.notes;
        element('plane-notes').textContent = notes.length ? `Not all lines could be followed: ${notes.join('; ')}` : 'Click at a point to take its data.';
        drawPlane();
      };
      if (planeLines === null) { find(); return; }
      later = setTimeout(find, 150);
    }
    drawPlane();
  };
  element('plane-drawing').addEventListener('pointerdown', (event) => {
    const svg = event.target.closest('svg');
    if (!svg || !planeFrame) return;
    const s = state[state.tab];
    const plane = planeOf(s);
    const box = svg.getBoundingClientRect();
    const scale = svg.viewBox.baseVal.width / box.width;
    const back = ([lower, upper], share) => Number((lower + clamp(share, 0, 1) * (upper - lower)).toFixed(2));
    const load = back(plane.load, ((event.clientX - box.left) * scale - planeFrame.left) / (planeFrame.right - planeFrame.left));
    const friction = back(plane.friction, (planeFrame.bottom - (event.clientY - box.top) * scale) / (planeFrame.bottom - planeFrame.top));
    if (s.mode === 'F') { s.load[s.plane] = load; s.at = clamp(friction, ...s.range); }
    else { const first = s.F[0]; s.at = clamp(load, ...s.range); s.F = s.F.map((f) => (first === 0 ? friction : (f / first) * friction)); }
    changed();
  });

  const tables = () => {
    const { s, diagram, solutions } = current;
    const p = nodes(s);
    const perNode = (names) => Array.from({ length: p }, (_, k) => names.map((n) => inHtml(p === 1 || n.includes('_') ? n + index(s, k) : `${n}_${k + 1}`))).flat();
    element('at-words').innerHTML = `${parameterName(s)} = ${shown(s.at)}`;
    const count = solutions.solutions.length;
    element('certificate').textContent = `${count} ${count === 1 ? 'solution' : 'solutions'}${solutions.continua.length ? ` and ${solutions.continua.length} ${solutions.continua.length === 1 ? 'continuum' : 'continua'}` : ''}; the list is ${solutions.completeness}${solutions.complete ? ' (proven in exact arithmetic)' : ''}`;
    element('index-sum').textContent = indexSum(solutions.index_sum);
    const rows = solutions.solutions.map((one, k) => [
      `<label><input type="radio" name="solution" value="${k}"${k === current.chosen ? ' checked' : ''} aria-label="Show solution ${k + 1}"> ${k + 1}</label>`,
      said(one.pieces), one.det.map(signOf).join(' '),
      ...Array.from({ length: p }, (_, n) => [one.x[2 * n], one.x[2 * n + 1], one.x[2 * p + n], one.x[3 * p + n]]).flat(),
    ]);
    for (const c of solutions.continua) {
      const ends = Array.from({ length: p }, (_, n) => [2 * n, 2 * n + 1, 2 * p + n, 3 * p + n]).flat();
      rows.push(['', `continuum of dimension ${c.dimension}: ${[...new Set(c.pieces.map(said))].join(' / ')}`, '', ...ends.map((k) => c.ends.map((x) => shown(x[k])).join(' … '))]);
    }
    const focused = document.activeElement?.name === 'solution' ? document.activeElement.value : null;
    table(element('solutions'), ['', 'states', 'det', ...perNode(['u_ν', 'u_t', 'λ_ν', 'λ_t'])], rows);
    if (focused !== null) element('solutions').querySelector(`[value="${focused}"]`)?.focus();

    element('completeness').textContent = `The curves found: ${diagram.completeness}. ${diagram.branches.length} ${diagram.branches.length === 1 ? 'branch' : 'branches'}, ${diagram.isolas} closed; folds at ${diagram.folds.length ? diagram.folds.map((f) => shown(f)).join(', ') : 'none'}.`.replace('folds at none', 'no folds');
    const events = diagram.vertices.filter((v) => v.number).sort((a, b) => a.number - b.number);
    table(element('transitions'), ['', 'kind', 'α', 'states', ...perNode(['θ¹', 'θ²', 'θ³'])], events.map((v) => [
      `T${v.number}`, v.kind, v.x[v.x.length - 1], v.arms.map(said).join(v.arms.length === 2 ? ' → ' : ' | '), ...v.theta.flat(),
    ]));
  };
  element('solutions').addEventListener('change', (event) => {
    current.chosen = Number(event.target.value);
    hovered = null;
    showChosen();
    body();
  });

  const redraw = () => {
    sliders();
    const s = copyOf(state[state.tab]);
    const problem = problemOf(s);
    const diagram = computations.ask({ ask: 'diagram', problem });
    const solutions = computations.ask({ ask: 'solutions', problem, alpha: s.at });
    const failed = diagram.error ?? solutions.error;
    fail(failed?.message);
    if (failed) return;
    const chosen = Math.min(current?.chosen ?? 0, Math.max(solutions.ok.solutions.length - 1, 0));
    current = { s, problem, diagram: diagram.ok, solutions: solutions.ok, chosen };
    const p = nodes(s);
    const moves = [...current.diagram.vertices.filter((v) => v.number), ...current.solutions.solutions].map((v) => Math.max(...v.x.slice(0, 2 * p).map(Math.abs)));
    const most = Math.max(0.01, ...moves);
    current.scale = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1].filter((k) => k * most <= 0.55).pop() ?? 0.55 / most;
    hovered = null;
    const box = element('branches');
    const room = available(box, 960);
    explore.show(pictures(colour(), p === 2 && room > 700 ? Math.floor((room - 8) / 2) : room));
    tables();
    showChosen();
    body();
    showPlane();
  };

  const showRange = intervalFields(element('lower'), element('upper'), () => state[state.tab]);
  element('example').addEventListener('change', (event) => {
    if (event.target.value === '') return;
    const { quantity } = state[state.tab];
    state[state.tab] = { ...copyOf(examples[state.tab][Number(event.target.value)][1]), quantity };
    changed();
  });
  element('mode').addEventListener('change', (event) => {
    const s = state[state.tab];
    s.mode = event.target.value;
    if (s.mode === 'load' && s.rate.every((r) => r === 0)) s.rate = s.rate.map((_, k) => (k === s.plane ? 1 : 0));
    changed();
  });
  element('quantity').addEventListener('change', (event) => { state[state.tab].quantity = event.target.value; changed(); });
  element('plane').addEventListener('change', (event) => { state[state.tab].plane = Number(event.target.value); changed(); });
  // One file for all nodes, in the light theme.
  element('save-branches').addEventListener('click', () => download('branches.svg', sideBySide(pictures(palettes.light, 480).map((p) => p.text), 480)));
  element('save-plane').addEventListener('click', () => download('transition-set.svg', planePicture(palettes.light, 480)));
  return { redraw, current: () => current };
})();
