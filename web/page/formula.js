// The tab with the user's formula.
const formulaTab = (() => {
  const fieldOf = [element('equation-0'), element('equation-1')];
  let current = null;

  const at = slider({
    id: 'a', label: 'a', name: 'parameter a', lower: () => state.formula.range[0], upper: () => state.formula.range[1],
    step: () => Number(((state.formula.range[1] - state.formula.range[0]) / 100).toPrecision(1)),
    get: () => state.formula.at, set: (v) => { state.formula.at = clamp(v, ...state.formula.range); },
  });
  element('formula-sliders').append(group('Parameter', [at]));
  options(element('formula-example'), [...examples.formula.map(([name], k) => [k, name]), ['', 'a formula of your own']]);

  const controls = () => {
    const s = state.formula;
    at.show();
    fieldOf.forEach((field, k) => { if (document.activeElement !== field) field.value = s.equations[k]; });
    if (document.activeElement !== element('reach')) element('reach').value = s.reach;
    showRange();
    const example = examples.formula.findIndex(([, e]) => same(data(e), data(s)));
    element('formula-example').value = example < 0 ? '' : String(example);
    const unknowns = s.equations[1].trim() === '' ? 1 : 2;
    if (unknowns === 1) s.quantity = 0;
    element('formula-quantity').value = String(s.quantity);
    element('formula-quantity-choice').hidden = unknowns === 1;
  };

  // An error is shown below its equation, with the place marked.
  const mistake = (error) => {
    fieldOf.forEach((field, k) => {
      const wrong = error?.equation === k;
      field.setAttribute('aria-invalid', String(wrong));
      const text = field.value;
      element(`mistake-${k}`).innerHTML = wrong
        ? `${escaped(error.message)} (character ${error.from + 1})<code>${escaped(text.slice(0, error.from))}<mark>${escaped(text.slice(error.from, error.to)) || '&nbsp;'}</mark>${escaped(text.slice(error.to))}</code>`
        : '';
    });
    fail(error && error.equation === undefined ? error.message : undefined);
  };

  const classes = (diagram) => [...new Set(diagram.edges.map((e) => e.pieces.join('; ')))];
  const picture = (colours, width) => {
    const { s, diagram, solutions } = current;
    const names = classes(diagram);
    return diagramPicture({
      diagram, colours, range: s.range, at: s.at, solutions: solutions.solutions.map((one) => one.x), value: (x) => x[s.quantity],
      style: (edge) => {
        const name = edge.pieces.join('; ');
        const k = names.indexOf(name);
        // Many classes: the legend names the first.
        return k < colours.cycle.length ? { label: name || 'solutions', colour: colours.cycle[k] } : { label: 'other pieces', colour: colours.grazing };
      },
      width, height: 400, xLabel: 'a', yLabel: 'xy'[s.quantity], title: '', name: `Solutions ${'xy'[s.quantity]} over a`,
    });
  };
  const values = (x) => `${x.slice(0, -1).map((v, k) => `${'xy'[k]} = ${shown(v, 6)}`).join(', ')}, a = ${shown(x[x.length - 1], 6)}`;
  const explore = explorer(element('formula-drawing'), () => 'Solutions over a: arrow keys move along them', (here) => {
    const edge = here && current.diagram.edges[here[0]];
    element('formula-here').textContent = edge ? `${values(edge.points[here[1]])}, det ${signOf(edge.det[here[1]])}; ${edge.pieces.join('; ')}` : '';
  });

  // What was shown of another formula is not left beside a mistake.
  const clear = () => {
    current = null;
    element('formula-drawing').replaceChildren();
    for (const name of ['here', 'certificate', 'index-sum', 'completeness']) element(`formula-${name}`).textContent = '';
    for (const name of ['solutions', 'events']) element(`formula-${name}`).replaceChildren();
    element('a-words').textContent = `a = ${shown(state.formula.at)}`;
  };

  const redraw = () => {
    controls();
    const s = copyOf(state.formula);
    // The curves are not recomputed while a moves.
    const { equations, range, reach } = s;
    const key = JSON.stringify([equations, range, reach]);
    const known = current?.key === key;
    const answer = computations.ask({ ask: 'formula', formula: { equations, range, reach, at: s.at, diagram: !known } });
    mistake(answer.error);
    if (answer.error) { clear(); return; }
    const { unknowns, solutions } = answer.ok;
    const diagram = answer.ok.diagram ?? current.diagram;
    current = { s, key, diagram, solutions };
    explore.show([picture(colour(), available(element('formula-drawing'), 960))]);
    element('formula-here').textContent = '';
    element('a-words').textContent = `a = ${shown(s.at)}`;
    const count = solutions.solutions.length;
    const proven = 'continua' in solutions;
    element('formula-certificate').textContent = proven
      ? `${count} ${count === 1 ? 'solution' : 'solutions'}${solutions.continua.length ? ` and ${solutions.continua.length} continua` : ''}; the list is ${solutions.completeness}${solutions.complete ? ' (proven in exact arithmetic)' : ''}`
      : `Search from many starts: ${solutions.completeness}`;
    element('formula-index-sum').textContent = proven ? indexSum(solutions.index_sum) : '';
    table(element('formula-solutions'), [...['x', 'y'].slice(0, unknowns), 'det', 'pieces'], solutions.solutions.map((one) => [
      ...one.x.slice(0, -1), one.det.map(signOf).join(' '), escaped(one.pieces.join('; ')),
    ]));
    element('formula-completeness').textContent = `The curves found: ${diagram.completeness}. ${diagram.branches.length} ${diagram.branches.length === 1 ? 'branch' : 'branches'}, ${diagram.isolas} closed.`;
    const smooth = diagram.edges.flatMap((e) => e.folds.map((k) => ['', 'smooth fold', e.points[k][e.points[k].length - 1], ...e.points[k].slice(0, -1), escaped(e.pieces.join('; '))]));
    const events = diagram.vertices.filter((v) => v.number).sort((a, b) => a.number - b.number);
    table(element('formula-events'), ['', 'kind', 'a', ...['x', 'y'].slice(0, unknowns), 'pieces'], [...events.map((v) => [
      `T${v.number}`, v.kind, v.x[v.x.length - 1], ...v.x.slice(0, -1), escaped(v.arms.map((a) => a.join('; ')).join(v.arms.length === 2 ? ' → ' : ' | ')),
    ]), ...smooth]);
  };

  const showRange = intervalFields(element('a-lower'), element('a-upper'), () => state.formula);
  fieldOf.forEach((field, k) => field.addEventListener('input', () => { state.formula.equations[k] = field.value; changed(); }));
  element('reach').addEventListener('input', (event) => { const v = Number(event.target.value); if (v >= 1e-3 && v <= 1e6) { state.formula.reach = v; changed(); } });
  element('formula-quantity').addEventListener('change', (event) => { state.formula.quantity = Number(event.target.value); changed(); });
  element('formula-example').addEventListener('change', (event) => {
    if (event.target.value === '') return;
    state.formula = copyOf(examples.formula[Number(event.target.value)][1]);
    changed();
  });
  element('save-formula').addEventListener('click', () => current && download('solutions.svg', picture(palettes.light, 720).text));
  return { redraw, current: () => current };
})();
