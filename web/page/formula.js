// The tab with the user's formula.
const formulaTab = (() => {
  const fieldOf = [element('equation-0'), element('equation-1')];
  let current = null;

  // Names in the equations that are neither functions nor variables are constants, each with a slider.
  const known = ['max', 'min', 'abs', 'sqrt', 'exp', 'ln', 'sin', 'cos', 'tan', 'atan', 'sinh', 'cosh', 'tanh', 'pi', 'x', 'y', 'a'];
  const named = (equations) => [...new Set(equations.flatMap((e) => [...e.matchAll(/(?<![\w.])[A-Za-z_]\w*(?!\w|\s*\()/g)].map((m) => m[0])))]
    .filter((name) => !known.includes(name));
  let sliders = [];
  let shownNames = '';
  const constants = () => {
    const names = named(state.formula.equations);
    const before = state.formula.constants;
    state.formula.constants = Object.fromEntries(names.map((name) => [name, before[name] ?? 1]));
    if (names.join() !== shownNames) {
      shownNames = names.join();
      sliders = names.map((name) => slider({
        id: `constant-${name}`, label: name, name: `constant ${name}`, lower: () => -10, upper: () => 10, step: () => 0.05,
        get: () => state.formula.constants[name] ?? 1, set: (v) => { state.formula.constants[name] = clamp(v, -1e9, 1e9); },
      }));
      element('constants').replaceChildren(...(names.length ? [group('Constants', sliders)] : []));
    }
    sliders.forEach((one) => one.show());
  };

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
    constants();
    fieldOf.forEach((field, k) => { if (document.activeElement !== field) field.value = s.equations[k]; });
    if (document.activeElement !== element('reach')) element('reach').value = s.reach;
    showRange();
    const example = exampleOf('formula');
    element('formula-told').textContent = toldOf('formula');
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
    const key = JSON.stringify([equations, s.constants, range, reach]);
    const unchanged = current?.key === key;
    const answer = computations.ask({ ask: 'formula', formula: { equations, constants: s.constants, range, reach, at: s.at, diagram: !unchanged } });
    mistake(answer.error);
    element('program').textContent = answer.error ? '' : programs[element('language').value](s, answer.ok.solutions.solutions);
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

  // The problem as a program or a file that gives the same curves.
  const pairs = (s, pair) => Object.entries(s.constants).map(([name, value]) => pair(name, value));
  // Words that mean something else in the program below.
  const taken = /\b(and|as|assert|async|await|break|class|continue|def|del|elif|else|except|finally|for|from|global|if|import|in|is|lambda|nonlocal|not|or|pass|raise|return|try|while|with|yield|None|True|False|np|ss|v|H|starts|curves)\b/g;
  const inPython = (text) => text.replace(taken, '$1_').replaceAll('^', '**').replace(/\b(sqrt|exp|sin|cos|tan|sinh|cosh|tanh|pi)\b/g, 'np.$1').replace(/\bln\b/g, 'np.log').replace(/\batan\b/g, 'np.arctan');
  const given = (s) => s.equations.filter((e) => e.trim() !== '');
  const zero = (text) => { const [left, right] = text.split('='); return right === undefined ? left.trim() : `${left.trim()} - (${right.trim()})`; };
  const unknownsOf = (s) => ['x', 'y'].slice(0, given(s).length);
  const programs = {
    python: (s, solutions) => ['import numpy as np', 'import semismooth as ss', '', ...pairs(s, (name, value) => `${inPython(name)} = ${value}`), '', 'def H(v):',
      `    ${unknownsOf(s).join(', ')}, a = v`, `    return [${given(s).map((e) => inPython(zero(e))).join(', ')}]`, '',
      `starts = [${solutions.map((one) => `[${one.x.join(', ')}]`).join(', ')}]  # the solutions at a = ${s.at}`,
      `curves = ss.diagram(H, starts, (${s.range.join(', ')}))`, 'print(curves)', ''].join('\n'),
    rust: (s, solutions) => ['use semismooth::continuation::{ContinuationOptions, Diagram, DiagramOptions};', 'use semismooth::piecewise::{Formula, Traced};', '',
      'fn main() -> Result<(), Box<dyn std::error::Error>> {', `    let equations = [${given(s).map((e) => JSON.stringify(e)).join(', ')}];`,
      `    let constants: [(&str, f64); ${Object.keys(s.constants).length}] = [${pairs(s, (name, value) => `("${name}", ${value}_f64)`).join(', ')}];`,
      `    let map = Traced::new(Formula::read_with(&equations, &[${[...unknownsOf(s), 'a'].map((v) => `"${v}"`).join(', ')}], &constants)?);`,
      `    let range = ContinuationOptions::default().with_parameter_range((${s.range.map((v) => `${v}_f64`).join(', ')}));`,
      `    let starts: [[f64; ${unknownsOf(s).length + 1}]; ${solutions.length}] = [${solutions.map((one) => `[${one.x.map((v) => `${v}_f64`).join(', ')}]`).join(', ')}]; // the solutions at a = ${s.at}`,
      '    let curves = Diagram::explore(&map, &starts, &DiagramOptions::default().with_continuation(range))?;', '    println!("{curves}");', '    Ok(())', '}', ''].join('\n'),
    toml: (s, solutions) => ['# semismooth diagram THIS_FILE', '[problem]', `unknowns = ${JSON.stringify(unknownsOf(s))}`, 'parameter = "a"', `equations = ${JSON.stringify(given(s))}`,
      ...(Object.keys(s.constants).length ? [`constants = { ${pairs(s, (name, value) => `${name} = ${Number.isInteger(value) ? value.toFixed(1) : value}`).join(', ')} }`] : []), '', '[run]',
      `range = [${s.range.map((v) => (Number.isInteger(v) ? v.toFixed(1) : v)).join(', ')}]`,
      `starts = [${solutions.map((one) => `[${one.x.map((v) => (Number.isInteger(v) ? v.toFixed(1) : v)).join(', ')}]`).join(', ')}] # the solutions at a = ${s.at}`, ''].join('\n'),
  };
  element('language').addEventListener('change', redraw);
  element('copy').addEventListener('click', () => {
    const text = element('program').textContent;
    const done = () => { element('copied').textContent = 'Copied.'; };
    // Without permission for the clipboard the text is marked, to be copied by hand.
    const marked = () => { getSelection().selectAllChildren(element('program')); element('copied').textContent = 'Marked: copy it with the keyboard.'; };
    (navigator.clipboard ? navigator.clipboard.writeText(text).then(done, marked) : marked());
  });

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
  return { redraw, current: () => current, program: () => element('program').textContent };
})();
