// The state of the page, and its encoding in the address.
const zeros = (n) => Array(n).fill(0);
const friction = (nodes, data) => ({
  lambda: 1, mu: 1, mode: 'F', rate: zeros(2 * nodes), F: Array(nodes).fill(nodes === 1 ? 3 : 4), ratio: 1,
  range: [-0.5, 10], at: 4, quantity: 'ut', plane: nodes === 1 ? 1 : 3, ...data,
});
const examples = {
  one: [
    ['Example 1: one branch', friction(1, { load: [1.5, 7] })],
    ['Example 2: two branches', friction(1, { load: [1.5, -4] })],
    ['Example 3: a bifurcating branch', friction(1, { load: [1, -2] })],
    ['Example 4: the bifurcation perturbed', friction(1, { load: [0.92, -2] })],
  ],
  two: [
    ['Example 1: friction path', friction(2, { load: [0.4, -2.1417, 1.3717, -2.1417] })],
    ['Example 2: load path', friction(2, {
      mode: 'load', load: [0.4, 0.2, 1.8, -0.1], rate: [-0.1, 1.1, 0.2, 0.8], range: [-6, 10], at: -2.5,
    })],
  ],
  formula: [
    ['A fold at a kink', { equations: ['abs(x) = a', ''], range: [-1, 2], at: 1, reach: 3, quantity: 0 }],
    ['Mutual inhibition: two saturated unknowns', { equations: ['x = max(0, min(2, a - 1.6*y))', 'y = max(0, min(2, 1 - 1.6*x))'], range: [-1, 3], at: 1, reach: 3, quantity: 0 }],
    ['A cubic followed by a rectifier', { equations: ['x^3 - x = a', 'y = max(x, 0)'], range: [-1, 1], at: 0, reach: 2, quantity: 1 }],
    ['A tunnel diode, 1 kΩ in series', {
      equations: ['a = y + x', 'y = 10*x - 14*max(x - 0.1, 0) + 4*max(x - 0.35, 0) + 0.001*(exp(x/0.075) - 1)'],
      range: [0, 2], at: 0.8, reach: 1, quantity: 1,
    }],
  ],
};
const copyOf = (value) => JSON.parse(JSON.stringify(value));
const state = { tab: 'one', one: copyOf(examples.one[0][1]), two: copyOf(examples.two[0][1]), formula: copyOf(examples.formula[0][1]) };
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
// The keys that an example fixes; those of the view remain free.
const data = ({ lambda, mu, mode, load, rate, F, ratio, range, equations, reach }) => ({ lambda, mu, mode, load, rate, F, ratio, range, equations, reach });

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
  formula: { equations: (text, fallback) => { const list = text.split('\n'); return list.length === 2 ? list : fallback; }, range: numbers(2), at: number, reach: number, quantity: number },
};
const fieldsOf = (tab) => (tab === 'formula' ? fields.formula : fields.friction(tab === 'one' ? 1 : 2));

const address = () => {
  const shownState = state[state.tab];
  const list = [['tab', state.tab], ...Object.keys(fieldsOf(state.tab)).map((key) => {
    const value = shownState[key];
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
