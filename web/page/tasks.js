// Tasks from the lessons of the book, each with a check of what the page shows.
const tasks = (() => {
  const kinds = (diagram) => diagram.vertices.map((v) => v.kind);
  const folds = (diagram) => diagram.folds.length;
  const spring = examples.formula[0][1];
  // A friction problem counts as solved only in the tab, and with the parameter, in which it was set up.
  const friction = (check) => () => { const c = state.tab === 'one' && frictionTab.current(); return Boolean(c) && check(state.one, c.diagram, c.solutions); };
  const formula = (check) => () => { const c = state.tab === 'formula' && formulaTab.current(); return Boolean(c) && check(c.s, c.diagram, c.solutions); };
  const list = [
    {
      name: 'No jump', lesson: ['04-following', 'Lesson 4: Following a curve'],
      text: 'The spring jumps twice, at two folds. Change the constant k until the curve has no fold, without touching the equation.',
      tab: 'formula', start: spring, check: formula((s, diagram) => same(s.equations, spring.equations) && folds(diagram) === 0),
    },
    {
      name: 'Three solutions', lesson: ['06-all-solutions', 'Lesson 6: All solutions'],
      text: 'Two unknowns hold each other down. Move a until the list has exactly three solutions, and is proven complete.',
      tab: 'formula', start: { ...examples.formula[2][1], at: 2.8 },
      check: formula((s, _, solutions) => same(s.equations, examples.formula[2][1].equations) && solutions.complete && solutions.solutions.length === 3),
    },
    {
      name: 'A proof', lesson: ['08-certificates', 'Lesson 8: Certificates'],
      text: 'The solutions of this cubic are found by a search, which proves nothing. Write a first equation with max, min or abs and without powers that has three solutions at a = 0, so that the list is proven.',
      tab: 'formula', start: examples.formula[3][1],
      check: formula((s, _, solutions) => 'continua' in solutions && solutions.complete && solutions.solutions.length === 3 && Math.abs(s.at) < 1e-9),
    },
    {
      name: 'Branches apart', lesson: ['07-diagrams', 'Lesson 7: Diagrams'],
      text: 'In Example 3 branches meet in one point. Change one load by less than 0.2 so that they no longer do.',
      tab: 'one', start: examples.one[2][1],
      check: friction((s, diagram) => s.mode === 'F' && !same(s.load, [1, -2]) && Math.abs(s.load[0] - 1) + Math.abs(s.load[1] + 2) < 0.2 && !kinds(diagram).some((k) => k.startsWith('branch'))),
    },
    {
      name: 'No contact', lesson: ['09-friction', 'Lesson 9: Friction'],
      text: 'Choose a load under which the node is open at every coefficient of friction in the range, and there is no other solution.',
      tab: 'one', start: examples.one[0][1],
      check: friction((_, diagram, solutions) => diagram.edges.length > 0 && diagram.edges.every((e) => e.pieces.every((p) => p === 'open')) && solutions.complete && solutions.solutions.length === 1),
    },
  ];
  const done = new Set();
  let chosen = 0;
  let set = null; // The task that was set up.
  // Where the page lies beside the book, whose place a web site tells in this element, the lesson is a link.
  const book = document.querySelector('meta[name="book"]')?.content ?? '';
  const show = () => {
    const { text, lesson } = list[chosen];
    element('task').value = String(chosen);
    element('task-text').textContent = text;
    element('task-state').textContent = done.has(chosen) ? 'Done.' : set === chosen ? 'Not yet.' : '';
    element('task-lesson').innerHTML = book ? `<a href="${book}lessons/${lesson[0]}/lesson.html">${escaped(lesson[1])}</a>` : escaped(`See ${lesson[1]} of the book.`);
    element('tasks-done').textContent = done.size ? `(${done.size} done)` : '';
  };
  options(element('task'), list.map(({ name }, k) => [k, `${k + 1}. ${name}`]));
  element('task').addEventListener('change', (event) => { chosen = Number(event.target.value); set = null; show(); });
  element('task-start').addEventListener('click', () => {
    const { tab, start } = list[chosen];
    set = chosen;
    state[tab] = copyOf(start);
    chooseTab(tab);
    show();
  });
  show();
  // Called after each drawing. A task counts once it was set up.
  return { look: () => { if (set !== null && list[set].check()) done.add(set); show(); } };
})();
