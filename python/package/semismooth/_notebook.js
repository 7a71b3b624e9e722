// A curve or diagram in a notebook, drawn by the functions of the page (`_drawing.js`, before this text) in the place of its static picture:
// the quantity on the vertical axis is chosen, and the nearest point is told where the pointer or an arrow key is.
const room = document.getElementById(own.id);
if (room) {
  const dark = () => document.body.dataset.jpThemeLight === 'false'
    || (document.body.dataset.jpThemeLight === undefined && matchMedia('(prefers-color-scheme: dark)').matches);
  const place = document.createElement('div');
  const told = document.createElement('p');
  const label = document.createElement('label');
  const choice = document.createElement('select');
  own.names.slice(0, -1).forEach((name, k) => choice.add(new Option(name, k)));
  label.append('vertical axis: ', choice);
  label.hidden = own.names.length < 3;
  told.setAttribute('aria-live', 'polite');
  told.textContent = 'Point at the picture, or use the arrow keys, to read off values.';
  place.tabIndex = 0;
  const points = own.drawing.edges.flatMap((edge) => edge.points);
  const range = padded(points.map((x) => x[x.length - 1]));
  let [picture, near] = [null, 0];
  const draw = () => {
    const [colours, drawn] = [palettes[dark() ? 'dark' : 'light'], Number(choice.value)];
    const labels = new Map();
    const style = (edge) => {
      const text = edge.label || 'curve';
      if (!labels.has(text)) labels.set(text, colours.cycle[labels.size] ?? colours.grazing);
      return { label: text, colour: labels.get(text) };
    };
    picture = diagramPicture({
      // No value of the parameter is marked: one that is outside of the picture.
      diagram: own.drawing, value: (x) => x[drawn], style, range, at: 2 * range[0] - range[1], solutions: [], colours,
      width: 640, height: 400, xLabel: own.names[own.names.length - 1], yLabel: own.names[drawn], name: own.id,
    });
    place.innerHTML = picture.text;
    place.firstChild.style.maxWidth = '100%';
    place.style.color = colours.ink;
  };
  const tell = (k) => {
    if (!points.length) return;
    near = Math.min(Math.max(k, 0), points.length - 1);
    const [x, { X, Y }] = [points[near], picture.frame];
    place.querySelector('.cursor').innerHTML = `<circle cx="${X(x[x.length - 1])}" cy="${Y(x[Number(choice.value)])}" r="7" fill="none" stroke="currentColor" stroke-width="2.5"/>`;
    told.textContent = own.names.map((name, i) => `${name} = ${shown(x[i], 6)}`).join(', ');
  };
  place.addEventListener('pointermove', (event) => {
    const svg = place.firstChild;
    const box = svg.getBoundingClientRect();
    const [u, v] = [event.clientX - box.left, event.clientY - box.top].map((d) => (d * svg.width.baseVal.value) / box.width);
    const { X, Y } = picture.frame;
    const away = points.map((x) => Math.hypot(X(x[x.length - 1]) - u, Y(x[Number(choice.value)]) - v));
    tell(away.indexOf(Math.min(...away)));
  });
  place.addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    tell(near + step);
  });
  choice.addEventListener('change', draw);
  draw();
  // Only now, so that the static picture stays where this fails.
  room.replaceChildren(label, place, told);
}
