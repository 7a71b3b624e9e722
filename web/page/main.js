// Tabs, theme, the address, and when to draw.
const colour = () => palettes[document.documentElement.classList.contains('dark') ? 'dark' : 'light'];
const fail = (message) => { element('failure').hidden = !message; element('failure').textContent = message ?? ''; };
const tabs = ['one', 'two', 'formula'];
// Time of the last drawing in milliseconds, the part spent on computations, and the number of drawings: for the footer of the page and for
// tests.
const drawn = { count: 0, milliseconds: 0, computed: 0 };

let ready = false;
const redraw = () => {
  if (!ready) return;
  const [begun, before] = [performance.now(), computations.spent()];
  (state.tab === 'formula' ? formulaTab : frictionTab).redraw();
  tasks.look();
  drawn.count += 1;
  drawn.milliseconds = performance.now() - begun;
  drawn.computed = computations.spent() - before;
  element('time').textContent = `Computed and drawn in ${drawn.milliseconds.toFixed(1)} ms.`;
};

// At most one drawing per frame; the address is updated when input pauses, since browsers limit the rate of changes.
let wanted = false;
let resting = 0;
const changed = () => {
  clearTimeout(resting);
  resting = setTimeout(() => history.replaceState(null, '', address()), 250);
  if (wanted) return;
  wanted = true;
  requestAnimationFrame(() => { wanted = false; redraw(); });
};

const showTab = () => {
  rooms.clear();
  for (const tab of tabs) {
    const button = element(`tab-${tab}`);
    button.setAttribute('aria-selected', String(tab === state.tab));
    button.tabIndex = tab === state.tab ? 0 : -1;
  }
  element('panel-friction').hidden = state.tab === 'formula';
  element('panel-formula').hidden = state.tab !== 'formula';
  element('panel-friction').setAttribute('aria-labelledby', `tab-${state.tab === 'two' ? 'two' : 'one'}`);
};
const chooseTab = (tab) => { state.tab = tab; showTab(); changed(); };
tabs.forEach((tab, k) => {
  const button = element(`tab-${tab}`);
  button.addEventListener('click', () => chooseTab(tab));
  button.addEventListener('keydown', (event) => {
    const to = { ArrowRight: (k + 1) % 3, ArrowLeft: (k + 2) % 3, Home: 0, End: 2 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    element(`tab-${tabs[to]}`).focus();
    chooseTab(tabs[to]);
  });
});

// Pictures of several panels in one file.
const sideBySide = (texts, width) => {
  if (texts.length === 1) return texts[0];
  const heights = texts.map((t) => Number(t.match(/height="(\d+)"/)[1]));
  const placed = texts.map((t, k) => t.replace('<svg ', `<svg x="${k * width}" `).replaceAll(/clip-[a-z0-9]+-\d+/gi, (id) => `${id}-${k}`));
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width * texts.length}" height="${Math.max(...heights)}">${placed.join('')}</svg>`;
};

const setTheme = (dark) => {
  document.documentElement.classList.toggle('dark', dark);
  // The button says what it does.
  element('theme').textContent = dark ? 'Light theme' : 'Dark theme';
};
element('theme').addEventListener('click', () => { setTheme(!document.documentElement.classList.contains('dark')); redraw(); });
const preferred = matchMedia('(prefers-color-scheme: dark)');
preferred.addEventListener('change', () => { setTheme(preferred.matches); redraw(); });

// The address in the event: the page may have changed its own since.
addEventListener('hashchange', (event) => { if (readAddress(new URL(event.newURL).hash)) { showTab(); changed(); } });
let lastWidth = 0;
addEventListener('resize', () => { if (innerWidth !== lastWidth) { lastWidth = innerWidth; rooms.clear(); changed(); } });
document.querySelectorAll('form').forEach((form) => form.addEventListener('submit', (event) => event.preventDefault()));

setTheme(preferred.matches);
readAddress(location.hash);
showTab();
computations.load().then(() => { ready = true; redraw(); }, (error) => fail(`This browser does not run the computations: ${error.message}`));
