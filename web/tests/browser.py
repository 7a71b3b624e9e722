"""Tests of the page in headless Chromium, driven by its DevTools protocol over a pipe; needs only Python's standard library.

Usage: browser.py PAGE CRATE.json [--pictures FOLDER]
PAGE is the built index.html; CRATE.json has questions and the answers of the crate in native code.
"""

import argparse
import base64
import functools
import http.server
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import xml.etree.ElementTree as ElementTree

PATIENCE = 60.0


class Browser:
    """One browser with one page. Its console messages are recorded."""

    def __init__(self, program):
        self.profile = tempfile.mkdtemp()
        to_browser, self.writing = os.pipe()
        self.reading, from_browser = os.pipe()

        def pipes():
            # Each of the two descriptors may have the number that the other must get.
            spare = [os.dup(to_browser), os.dup(from_browser)]
            os.dup2(spare[0], 3)
            os.dup2(spare[1], 4)

        flags = [
            "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--no-first-run", "--disable-gpu", "--disable-dev-shm-usage",
            "--disable-background-networking", "--disable-component-update", "--force-device-scale-factor=1", "--hide-scrollbars",
            f"--user-data-dir={self.profile}", "about:blank",
        ]
        self.process = subprocess.Popen(
            [program, *flags], preexec_fn=pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self.count, self.rest, self.session = 0, b"", None
        self.said, self.requests, self.answers = [], [], {}
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Log", "Network"]:
            self.call(f"{domain}.enable")

    def receive(self, until):
        import select

        while b"\0" not in self.rest:
            wait = until - time.monotonic()
            if wait <= 0 or not select.select([self.reading], [], [], wait)[0]:
                raise TimeoutError("the browser does not answer")
            part = os.read(self.reading, 1 << 20)
            if not part:
                raise EOFError("the browser has ended")
            self.rest += part
        message, _, self.rest = self.rest.partition(b"\0")
        message = json.loads(message)
        method, details = message.get("method"), message.get("params", {})
        if "id" in message:
            self.answers[message["id"]] = message
        elif method == "Runtime.consoleAPICalled" and details["type"] in ("error", "warning", "assert"):
            self.said.append(str(details["args"]))
        elif method == "Runtime.exceptionThrown":
            self.said.append(str(details["exceptionDetails"]))
        elif method == "Log.entryAdded" and details["entry"]["level"] in ("error", "warning"):
            self.said.append(str(details["entry"]))
        elif method == "Network.requestWillBeSent":
            self.requests.append(details["request"]["url"])

    def call(self, method, **parameters):
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.writing, json.dumps(message).encode() + b"\0")
        until = time.monotonic() + PATIENCE
        while self.count not in self.answers:
            self.receive(until)
        answer = self.answers.pop(self.count)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def run(self, script):
        """The value of an expression in the page; promises are awaited."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def wait(self, condition):
        until = time.monotonic() + PATIENCE
        while not self.holds(condition):
            if time.monotonic() > until:
                raise TimeoutError(condition)
            time.sleep(0.02)

    def holds(self, condition):
        try:
            return self.run(condition)
        except RuntimeError:
            # The document is being replaced.
            return False

    def open(self, address):
        # From a blank page: another state of the same page would not reload it, and the wait below would end at once.
        self.call("Page.navigate", url="about:blank")
        self.wait("location.href === 'about:blank'")
        self.call("Page.navigate", url=address)
        page = json.dumps(address.partition("#")[0])
        self.wait(f"location.href.split('#')[0] === {page} && typeof drawn === 'object' && drawn.count > 0")

    def size(self, width, height, dark=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def key(self, key):
        code = {"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Home": 36, "End": 35, "Tab": 9, "PageUp": 33}[key]
        for kind in ["rawKeyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def mouse(self, kind, x, y, pressed=False):
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left" if pressed or kind != "mouseMoved" else "none",
            buttons=1 if pressed else 0, clickCount=0 if kind == "mouseMoved" else 1,
        )

    def settle(self):
        """Waits until the change is drawn."""
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self, path):
        height = self.run("document.documentElement.scrollHeight")
        width = self.run("innerWidth")
        clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
        data = self.call("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)["data"]
        pathlib.Path(path).write_bytes(base64.b64decode(data))

    def close(self):
        try:
            session, self.session = self.session, None
            self.call("Browser.close")
        except (RuntimeError, EOFError, BrokenPipeError, TimeoutError):
            pass
        self.process.wait(timeout=20)
        shutil.rmtree(self.profile, ignore_errors=True)


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Page(unittest.TestCase):
    page = crate = pictures = program = None

    @classmethod
    def setUpClass(cls):
        folder = functools.partial(Quiet, directory=str(cls.page.parent))
        cls.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), folder)
        threading.Thread(target=cls.server.serve_forever, daemon=True).start()
        cls.address = f"http://127.0.0.1:{cls.server.server_address[1]}/{cls.page.name}"
        cls.browser = Browser(cls.program)

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.server.shutdown()
        cls.server.server_close()

    def setUp(self):
        self.browser.size(1280, 900)
        self.browser.said.clear()
        # A new document each time, whatever the address is.
        self.browser.call("Page.navigate", url="about:blank")

    def tearDown(self):
        self.assertEqual(self.browser.said, [])

    def load(self, state=""):
        self.browser.open(self.address + state)

    def centre(self, selector):
        return self.browser.run(
            f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView({{ block: 'center' }});"
            " const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()"
        )

    def work(self):
        """Processor time of the page so far, in seconds."""
        metrics = {m["name"]: m["value"] for m in self.browser.call("Performance.getMetrics")["metrics"]}
        return sum(metrics[name] for name in ["ScriptDuration", "LayoutDuration", "RecalcStyleDuration"])

    def same(self, a, b, path=""):
        """Equal texts, numbers up to rounding: the order of sums may differ between compilations."""
        if isinstance(b, float) or isinstance(a, float):
            self.assertTrue(abs(a - b) <= 1e-9 * (1 + abs(b)), f"{path}: {a} and {b}")
        elif isinstance(b, dict):
            self.assertEqual(sorted(a), sorted(b), path)
            for key in b:
                self.same(a[key], b[key], f"{path}.{key}")
        elif isinstance(b, list):
            self.assertEqual(len(a), len(b), path)
            for k, (x, y) in enumerate(zip(a, b)):
                self.same(x, y, f"{path}[{k}]")
        else:
            self.assertEqual(a, b, path)

    def test_answers_are_those_of_the_crate(self):
        self.load()
        cases = json.loads(self.crate.read_text())
        self.assertGreater(len(cases), 10)
        for case in cases:
            found = self.browser.run(f"computations.ask({json.dumps(case['question'])})")
            self.same(found, case["answer"], json.dumps(case["question"])[:60])

    def test_nothing_is_fetched_but_the_page(self):
        self.browser.requests.clear()
        self.load()
        fetched = [r for r in self.browser.requests if not r.startswith(("data:", "blob:", "about:"))]
        self.assertEqual(fetched, [self.address])

    def test_a_file_is_enough(self):
        self.browser.open(self.page.resolve().as_uri())
        self.assertEqual(self.browser.run("document.querySelectorAll('#branches svg').length"), 1)

    def test_dragging_a_slider_redraws(self):
        # The six problems of the talk.
        for tab, example, slider in [("one", 0, "load-1"), ("one", 1, "load-1"), ("one", 2, "load-1"), ("one", 3, "load-1"), ("two", 0, "load-1"), ("two", 1, "load-1")]:
            self.load(f"#tab={tab}")
            self.browser.run(f"(() => {{ const e = document.querySelector('#example'); e.value = '{example}'; e.dispatchEvent(new Event('change')); }})()")
            self.browser.settle()
            before = self.browser.run("[drawn.count, document.querySelector('#branches').innerHTML, state[state.tab].load[1]]")
            left, top, width, height = self.centre(f"#{slider}")
            y = top + height / 2
            place = self.browser.run(f"(() => {{ const s = document.querySelector('#{slider}'); return (s.value - s.min) / (s.max - s.min); }})()")
            x = left + 8 + place * (width - 16)
            self.browser.run("window.times = []")
            self.browser.call("Performance.enable", timeDomain="threadTicks")
            begun = self.work()
            self.browser.mouse("mousePressed", x, y, True)
            for k in range(1, 61):
                self.browser.mouse("mouseMoved", x + (left + 0.3 * width - x) * k / 60, y, True)
                self.browser.settle()
                self.browser.run("void times.push([drawn.milliseconds, drawn.computed])")
            spent = self.work() - begun
            self.browser.mouse("mouseReleased", left + 0.3 * width, y)
            after = self.browser.run("[drawn.count, document.querySelector('#branches').innerHTML, state[state.tab].load[1]]")
            self.assertGreater(after[0], before[0] + 20)
            self.assertNotEqual(after[1], before[1])
            self.assertLess(after[2], -2.0)
            # The page shows the results for the current data of the slider.
            self.assertTrue(self.browser.run(
                "same(frictionTab.current().diagram, computations.ask({ ask: 'diagram', problem: frictionTab.current().problem }).ok)"
                " && frictionTab.current().problem.load[1] === Number(document.querySelector('#load-1-exact').value)"
            ))
            times = self.browser.run("times")
            whole, computed = [sorted(column) for column in zip(*times)]
            of = lambda t: f"median {t[len(t) // 2]:.1f}, 19 of 20 within {t[int(0.95 * len(t))]:.1f}, largest {t[-1]:.1f} ms"
            print(f"\n{tab} {example + 1}: {len(times)} drawings while dragging: {of(whole)}; of it the crate {of(computed)}; "
                  f"processor time of scripts, style and layout {1e3 * spent / (after[0] - before[0]):.1f} ms each", file=sys.stderr)

    def test_the_tables_show_the_printed_theta(self):
        self.load("#tab=two")
        rows = self.browser.run("[...document.querySelectorAll('#transitions tbody tr')].map((r) => [...r.cells].map((c) => c.textContent))")
        self.assertEqual([row[0] for row in rows], ["T1", "T2", "T3"])
        # T2 as printed in the talk, with truncated digits, for a rounded load.
        printed = [0.4, -3.0019, -0.6407, 1.0513, -6.2056, 0.0]
        found = [float(v.replace("−", "-")) for v in rows[1][4:]]
        for a, b in zip(found, printed):
            self.assertLess(abs(a - b), 2.5e-4)
        self.assertEqual(rows[1][3], "slip −, stick → slip −, slip −")
        self.assertIn("proven", self.browser.run("document.querySelector('#certificate').textContent"))

    def test_tabs_sliders_and_curves_by_keyboard(self):
        self.load()
        self.browser.run("document.querySelector('#tab-one').focus()")
        for tab, panel in [("two", "friction"), ("formula", "formula"), ("one", "friction")]:
            self.browser.key("ArrowRight")
            self.browser.settle()
            self.assertEqual(self.browser.run("document.activeElement.id"), f"tab-{tab}")
            self.assertEqual(self.browser.run(f"document.querySelector('#tab-{tab}').getAttribute('aria-selected')"), "true")
            self.assertEqual(self.browser.run("[...document.querySelectorAll('main')].filter((m) => !m.hidden).map((m) => m.id)"), [f"panel-{panel}"])
        self.browser.run("document.querySelector('#load-0').focus()")
        self.browser.key("ArrowRight")
        self.browser.settle()
        self.assertAlmostEqual(self.browser.run("state.one.load[0]"), 1.05)
        self.assertEqual(self.browser.run("document.activeElement.id"), "load-0")
        self.browser.run("document.querySelector('#branches svg').focus()")
        seen = set()
        for key in ["ArrowRight", "ArrowRight", "ArrowLeft", "ArrowLeft", "ArrowLeft"]:
            self.browser.key(key)
            seen.add(self.browser.run("document.querySelector('#here').textContent"))
        self.assertGreater(len(seen), 2)
        self.assertTrue(all("u" in text and "θ" in text for text in seen), seen)
        # Every focusable element has an accessible name.
        nameless = self.browser.run(
            "[...document.querySelectorAll('input, select, button, svg[tabindex], [role=group]')].filter((e) =>"
            " !(e.getAttribute('aria-label') || e.labels?.length || e.textContent.trim())).map((e) => e.outerHTML)"
        )
        self.assertEqual(nameless, [])

    def test_hovering_shows_states_and_the_body(self):
        self.load("#tab=two")
        body = self.browser.run("document.querySelector('#body').innerHTML")
        left, top, width, height = self.centre("#branches svg")
        self.browser.mouse("mouseMoved", left + width * 0.7, top + height * 0.4)
        for k in range(12):
            self.browser.mouse("mouseMoved", left + width * 0.7, top + height * (0.1 + 0.06 * k))
            if self.browser.run("document.querySelector('#here').textContent").startswith("α"):
                break
        told = self.browser.run("document.querySelector('#here').textContent")
        self.assertIn("node 1", told)
        self.assertIn("θ²", told)
        self.assertNotEqual(self.browser.run("document.querySelector('#body').innerHTML"), body)

    def test_the_address_holds_the_state(self):
        self.load()
        self.browser.run(
            "(() => { chooseTab('two'); state.two.load[2] = 1.234567; state.two.at = 6.5; state.two.quantity = 'ln'; state.two.lambda = 2.5; changed(); })()"
        )
        self.browser.wait("location.hash.includes('1.234567')")
        address = self.browser.run("location.href")
        shown = "[JSON.stringify(state.two), document.querySelector('#transitions').textContent, document.querySelector('#solutions').textContent]"
        before = self.browser.run(shown)
        self.browser.call("Page.navigate", url="about:blank")
        self.browser.open(address)
        self.assertEqual(self.browser.run(shown), before)
        self.browser.run("location.hash = '#' + new URLSearchParams({ tab: 'formula', equations: 'abs(x) - a\\n', range: '-1,3', at: '2' })")
        self.browser.wait("!document.querySelector('#panel-formula').hidden && document.querySelector('#formula-certificate').textContent.startsWith('2 solutions')")
        # Malformed entries leave the state unchanged.
        self.browser.run("location.hash = '#tab=one&load=1,x&lambda=&range=5&mode=sideways'")
        self.browser.wait("state.tab === 'one' && !document.querySelector('#panel-friction').hidden")
        self.assertEqual(self.browser.run("[state.one.load, state.one.lambda, state.one.range, state.one.mode]"), [[1, -2], 1, [-0.5, 10], "F"])

    def test_pictures_are_files_of_their_own(self):
        folder = tempfile.mkdtemp()
        for state, button, name, least in [
            ("#tab=one", "save-branches", "branches.svg", 4), ("#tab=two", "save-branches", "branches.svg", 8),
            ("#tab=two", "save-plane", "transition-set.svg", 3), ("#tab=formula", "save-formula", "solutions.svg", 2),
        ]:
            self.load(state)
            self.browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=folder)
            path = pathlib.Path(folder, name)
            self.browser.run(f"document.querySelector('#{button}').click()")
            until = time.monotonic() + PATIENCE
            while not path.exists() or path.stat().st_size == 0:
                self.assertLess(time.monotonic(), until, name)
                self.browser.settle()
            root = ElementTree.parse(path).getroot()
            self.assertEqual(root.tag, "{http://www.w3.org/2000/svg}svg")
            paths = [p for p in root.iter("{http://www.w3.org/2000/svg}path") if "stroke" in p.attrib]
            self.assertGreaterEqual(len(paths), least)
            self.assertNotIn("NaN", path.read_text())
            path.unlink()
        shutil.rmtree(folder)

    def test_mistakes_in_formulas_are_marked(self):
        self.load("#tab=formula")
        self.browser.run("(() => { const e = document.querySelector('#equation-1'); e.focus(); e.value = 'y = max(x, '; e.dispatchEvent(new Event('input')); })()")
        self.browser.settle()
        self.assertEqual(self.browser.run("[...document.querySelectorAll('.equation input')].map((e) => e.getAttribute('aria-invalid'))"), ["false", "true"])
        self.assertIn("expected at the end", self.browser.run("document.querySelector('#mistake-1').textContent"))
        # Nothing of the formula before is left beside the mistake.
        shown = "[document.querySelectorAll('#formula-drawing svg').length, document.querySelector('#formula-certificate').textContent === '']"
        self.assertEqual(self.browser.run(shown), [0, True])
        self.browser.run("(() => { const e = document.querySelector('#equation-1'); e.value = ''; e.dispatchEvent(new Event('input')); })()")
        self.browser.settle()
        self.assertEqual(self.browser.run("document.querySelector('#mistake-1').textContent"), "")
        self.assertEqual(self.browser.run(shown), [1, False])

    def test_the_first_picture_is_explained(self):
        self.load()
        self.assertEqual(self.browser.run("document.querySelector('#example').selectedOptions[0].textContent"), "Example 3: a bifurcating branch")
        self.assertIn("meet in one point", self.browser.run("document.querySelector('#told').textContent"))
        # Data of one's own are not those of the example.
        self.browser.run("(() => { state.one.load[0] = 1.3; changed(); })()")
        self.browser.settle()
        self.assertEqual(self.browser.run("document.querySelector('#told').textContent"), "")

    def test_constants_have_sliders(self):
        self.load("#tab=formula")
        count = "formulaTab.current().solutions.solutions.length"
        self.assertEqual(self.browser.run(count), 3)
        # k = 0.5: 1 − k > 0, and the spring does not give way.
        self.browser.run("(() => { const e = document.querySelector('#constant-k-exact'); e.value = '0.5'; e.dispatchEvent(new Event('input')); })()")
        self.browser.settle()
        self.assertEqual(self.browser.run(f"[{count}, formulaTab.current().diagram.folds.length]"), [1, 0])
        self.browser.wait("location.hash.includes('k%3A0.5')")
        # Another name is another slider, in the address as well.
        self.browser.run("(() => { const e = document.querySelector('#equation-0'); e.value = 'stiffness*x - max(x, 0) = a'; e.dispatchEvent(new Event('input')); })()")
        self.browser.settle()
        self.assertEqual(self.browser.run("[...document.querySelectorAll('#constants input[type=range]')].map((e) => e.id)"), ["constant-stiffness"])
        self.browser.run("location.hash = '#' + new URLSearchParams({ tab: 'formula', equations: 'c*x = a\\n', constants: 'c:4', range: '-1,3', at: '2' })")
        self.browser.wait("state.formula.constants.c === 4 && formulaTab.current()?.solutions.solutions[0]?.x[0] === 0.5")

    def test_problems_are_programs(self):
        self.load("#tab=formula")
        text = lambda language: self.browser.run(
            f"(() => {{ const e = document.querySelector('#language'); e.value = '{language}'; e.dispatchEvent(new Event('change')); return formulaTab.program(); }})()"
        )
        python = text("python")
        self.assertIn("k = 1.25\n", python)
        self.assertIn("    x, a = v\n    return [x - k*max(x - 1, 0) + 10*max(x - 3, 0) - (a)]\n", python)
        compile(python, "program.py", "exec")
        self.assertIn('read_with(&equations, &["x", "a"], &constants)', text("rust"))
        self.assertIn('equations = ["x - k*max(x - 1, 0) + 10*max(x - 3, 0) = a"]\nconstants = { k = 1.25 }\n', text("toml"))
        # Names that Python does not allow.
        self.browser.run("(() => { state.formula.equations = ['x = lambda*a', '']; changed(); })()")
        self.browser.settle()
        self.assertIn("lambda_ = 1\n", text("python"))
        compile(text("python"), "program.py", "exec")
        # Powers and functions in the words of Python.
        self.browser.run("(() => { state.formula.equations = ['x^2 - exp(-x)*ln(a + 3)*pi', '']; changed(); })()")
        self.browser.settle()
        self.assertIn("return [x**2 - np.exp(-x)*np.log(a + 3)*np.pi]", text("python"))

    def test_tasks_are_checked(self):
        self.load()
        answers = [
            "state.formula.constants.k = 0.8", "state.formula.at = 1", "state.formula.equations[0] = '2*x - 3*max(x - 1, 0) - 3*min(x + 1, 0) - 2*a = 0'",
            "state.one.load[0] = 0.92", "state.one.load = [-3, 0]",
        ]
        for k, answer in enumerate(answers):
            self.browser.run(f"(() => {{ const e = document.querySelector('#task'); e.value = '{k}'; e.dispatchEvent(new Event('change')); document.querySelector('#task-start').click(); }})()")
            self.browser.settle()
            self.assertEqual(self.browser.run("document.querySelector('#task-state').textContent"), "Not yet.", answer)
            self.browser.run(f"(() => {{ {answer}; changed(); }})()")
            self.browser.settle()
            self.assertEqual(self.browser.run("document.querySelector('#task-state').textContent"), "Done.", answer)
        self.assertEqual(self.browser.run("document.querySelector('#tasks-done').textContent"), "(5 done)")

    def test_the_button_says_which_theme_it_turns_on(self):
        self.load("#tab=formula")
        said = "document.querySelector('#theme').textContent"
        before = self.browser.run(said)
        self.browser.run("document.querySelector('#theme').click()")
        self.assertEqual({before, self.browser.run(said)}, {"Dark theme", "Light theme"})

    def test_dark_and_narrow(self):
        for width, dark in [(1280, False), (1280, True), (390, False), (390, True)]:
            self.browser.size(width, 900, dark)
            for state in ["#tab=one&load=1.5,-4", "#tab=two", "#tab=two&mode=load&load=0.4,0.2,1.8,-0.1&rate=-0.1,1.1,0.2,0.8&range=-6,10&at=-2.5", "#tab=formula"]:
                self.browser.call("Page.navigate", url="about:blank")
                self.load(state)
                self.browser.settle()
                paper = self.browser.run("getComputedStyle(document.body).backgroundColor")
                self.assertEqual(paper, "rgb(21, 24, 28)" if dark else "rgb(255, 255, 255)")
                self.assertEqual(self.browser.run("document.documentElement.scrollWidth <= innerWidth"), True, f"{width} {state}")
                self.assertTrue(self.overlaps() == [], f"{width} {state}: {self.overlaps()}")
                if self.pictures:
                    name = state.split("&")[0][5:] + ("-load" if "mode=load" in state else "")
                    self.browser.picture(self.pictures / f"{name}-{width}-{'dark' if dark else 'light'}.png")

    def overlaps(self):
        """Texts in drawings that overlap each other or extend beyond their drawing."""
        return self.browser.run("""(() => {
            const found = [];
            for (const svg of document.querySelectorAll('main:not([hidden]) svg')) {
                const frame = svg.getBoundingClientRect();
                const boxes = [...svg.querySelectorAll('text')].map((t) => [t.textContent, t.getBoundingClientRect()]);
                boxes.forEach(([a, p], i) => {
                    if (p.left < frame.left - 1 || p.right > frame.right + 1 || p.top < frame.top - 1 || p.bottom > frame.bottom + 1) found.push([a, 'leaves']);
                    boxes.slice(i + 1).forEach(([b, q]) => {
                        if (p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 3 && q.top < p.bottom - 3) found.push([a, b]);
                    });
                });
            }
            return found;
        })()""")


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("page", type=pathlib.Path)
    arguments.add_argument("crate", type=pathlib.Path)
    arguments.add_argument("--pictures", type=pathlib.Path)
    arguments.add_argument("--only")
    given = arguments.parse_args()
    Page.page, Page.crate, Page.pictures = given.page, given.crate, given.pictures
    Page.program = next((p for p in map(shutil.which, ["chromium", "chromium-browser", "google-chrome"]) if p), None)
    if Page.program is None:
        sys.exit("no chromium is installed")
    unittest.main(argv=["browser.py", "-v"] + ([f"Page.{given.only}"] if given.only else []))
