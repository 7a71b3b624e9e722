// The state of the page, and its encoding in the address.
const zeros = (n) => Array(n).fill(0);
const friction = (nodes, data) => ({
  lambda: 1, mu: 1, mode: 'F', rate: zeros(2 * nodes), F: Array(nodes).fill(nodes === 1 ? 3 : 4), ratio: 1,
  range: [-0.5, 10], at: 4, quantity: 'ut', plane: nodes === 1 ? 1 : 3, ...data,
});
const examples = {
  one: [
    ['Example 1: one branch', friction(1, { load: [1.5, 7] }),
      'One branch passes through the whole range. Where its colour changes, the node changes its state: it opens, sticks or slips.'],
    ['Example 2: two branches', friction(1, { load: [1.5, -4] }),
      'Two branches do not meet: whoever follows one of them never finds the other. The list below counts the solutions at the chosen coefficient of friction, and proves that there are no others.'],
    ['Example 3: a bifurcating branch', friction(1, { load: [1, -2] }),
      'Branches meet in one point, where the node has no contact force: which of them a body takes is decided by the smallest change of its load. Example 4 is such a change.'],
    ['Example 4: the bifurcation perturbed', friction(1, { load: [0.92, -2] }),
      'The load of Example 3, changed a little: the branches no longer meet. A method that only follows one of them sees nothing of the others.'],
  ],
  two: [
    ['Example 1: friction path', friction(2, { load: [0.4, -2.1417, 1.3717, -2.1417] }),
      'Both nodes may be open, stick or slip: nine combinations or more for one load. T1, T2, … mark where one of them changes, with the test functions that vanish there in the table below.'],
    ['Example 2: load path', friction(2, {
      mode: 'load', load: [0.4, 0.2, 1.8, -0.1], rate: [-0.1, 1.1, 0.2, 0.8], range: [-6, 10], at: -2.5,
    }), 'The load grows with α while friction stays. Where the curve turns back, the body jumps when its load grows further.'],
  ],
  formula: [
    ['A spring that gives way', {
      equations: ['x - k*max(x - 1, 0) + 10*max(x - 3, 0) = a', ''], constants: { k: 1.25 }, range: [0, 2], at: 0.8, reach: 5, quantity: 0,
    }, 'Under a growing load a the spring jumps at the upper fold, and back at the lower one when it is unloaded; between them there are three solutions. For k < 1 nothing jumps.'],
    ['A fold at a kink', { equations: ['abs(x) = a', ''], constants: {}, range: [-1, 2], at: 1, reach: 3, quantity: 0 },
      'Two solutions for a > 0 meet at the kink, and there is none for a < 0.'],
    ['Mutual inhibition: two saturated unknowns', { equations: ['x = max(0, min(2, a - c*y))', 'y = max(0, min(2, 1 - c*x))'], constants: { c: 1.6 }, range: [-1, 3], at: 1, reach: 3, quantity: 0 },
      'Each unknown holds the other down: between the folds either may win, and the solution between them has det < 0.'],
    ['A cubic followed by a rectifier', { equations: ['x^3 - x = a', 'y = max(x, 0)'], constants: {}, range: [-1, 1], at: 0, reach: 2, quantity: 1 },
      'Smooth folds of the cubic, and kinks where x changes its sign. Its pieces are not affine: the list of solutions is found by a search, which proves nothing.'],
    ['A tunnel diode, 1 kΩ in series', {
      equations: ['a = y + x', 'y = 10*x - 14*max(x - 0.1, 0) + 4*max(x - 0.35, 0) + 0.001*(exp(x/0.075) - 1)'],
      constants: {}, range: [0, 2], at: 0.8, reach: 1, quantity: 1,
    }, 'The voltage x of the diode and its current y (mA) at the supply voltage a: where the characteristic falls, three states are possible.'],
  ],
};
const copyOf = (value) => JSON.parse(JSON.stringify(value));
const state = { tab: 'one', one: copyOf(examples.one[2][1]), two: copyOf(examples.two[0][1]), formula: copyOf(examples.formula[0][1]) };
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
// The keys that an example fixes; those of the view remain free.
const data = ({ lambda, mu, mode, load, rate, F, ratio, range, equations, constants, reach }) => ({ lambda, mu, mode, load, rate, F, ratio, range, equations, constants, reach });
const exampleOf = (tab) => examples[tab].findIndex(([, e]) => same(data(e), data(state[tab])));
// What one sees in an example, in two sentences.
const toldOf = (tab) => examples[tab][exampleOf(tab)]?.[2] ?? '';

// Names in the address, with their readers and writers.
const numbers = (length) => (text, fallback) => {
  const list = text.split(',').map(Number);
  return list.length === length && list.every(Number.isFinite) && !text.split(',').includes('') ? list : fallback;
};
const number = (text, fallback) => numbers(1)(text, [fallback])[0];
const one = (...words) => (text, fallback) => (words.includes(text) ? text : fallback);
const fields = {
  friction: (p) => ({
    lambda: number, mu: number, mode: one('F', 'load'), load: numbers(2 * p), rate: numbers(2 * p), F: numbers(p), ratio: number,
    range: numbers(2), at: number, quantity: one('ut', 'un', 'ln', 'lt'), plane: number,
  }),
  formula: { constants: (text, fallback) => {
    const pairs = text === '' ? [] : text.split(',').map((pair) => pair.split(':'));
    const read = pairs.map(([name, value]) => [name, value === undefined || value === '' ? NaN : Number(value)]);
    return read.every(([name, value]) => /^[A-Za-z_]\w*$/.test(name) && Number.isFinite(value)) ? Object.fromEntries(read) : fallback;
  }, equations: (text, fallback) => { const list = text.split('\n'); return list.length === 2 ? list : fallback; }, range: numbers(2), at: number, reach: number, quantity: number },
};
const fieldsOf = (tab) => (tab === 'formula' ? fields.formula : fields.friction(tab === 'one' ? 1 : 2));

const address = () => {
  const shownState = state[state.tab];
  const list = [['tab', state.tab], ...Object.keys(fieldsOf(state.tab)).map((key) => {
    const value = shownState[key];
    if (key === 'constants') return [key, Object.entries(value).map(([name, v]) => `${name}:${v}`).join(',')];
    return [key, Array.isArray(value) ? value.join(key === 'equations' ? '\n' : ',') : String(value)];
  })];
  return '#' + new URLSearchParams(list).toString();
};
// Reads the well-formed entries of the address; false if there are none.
const readAddress = (hash) => {
  const given = new URLSearchParams(hash.slice(1));
  const tab = given.get('tab');
  if (!['one', 'two', 'formula'].includes(tab)) return false;
  state.tab = tab;
  const target = state[tab];
  for (const [key, read] of Object.entries(fieldsOf(tab))) if (given.has(key)) target[key] = read(given.get(key), target[key]);
  if (tab !== 'formula') target.plane = Math.min(Math.max(Math.round(target.plane), 0), target.load.length - 1);
  else target.quantity = target.quantity === 1 ? 1 : 0;
  target.at = Math.min(Math.max(target.at, target.range[0]), target.range[1]);
  return true;
};
