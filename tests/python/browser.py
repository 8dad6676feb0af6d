"""A person with a browser: opens the page of a simulated flight and uses it.

usage: browser.py GLEANER_SITL [PICTURE]

GLEANER_SITL is the program. It is started here, because one check restarts it. PICTURE is where a screenshot of the
flight goes. Prints one JSON object with what was seen; exits with 1 and a line on stderr at the first thing that is not
as it should be.
"""

import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Error, expect, sync_playwright

# How long anything may take, wall time.
PATIENCE_MS = 60_000
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Server:
    """`gleaner-sitl serve` with the pilot inside, ten times as fast as the wall."""

    def __init__(self, program, port, out):
        self.command = [
            program, "serve", "--onboard", "--auto-takeoff", "--seed", "3", "--speed", "10",
            "--gcs", "udpin:127.0.0.1:0", "--http", f"127.0.0.1:{port}", "--out", out,
        ]
        self.process = None

    def start(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL)

    def stop(self):
        if self.process:
            self.process.terminate()
            self.process.wait()


def open_page(page, address):
    """The program may need a moment before it listens."""
    deadline = time.monotonic() + PATIENCE_MS / 1000
    while True:
        try:
            return page.goto(address)
        except Error:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.2)


def figure(page, name):
    """The value beside a name in the panel of figures."""
    return page.locator("#figures div", has=page.locator("dt", has_text=name)).locator("dd")


def fly(page, picture):
    """Engages, turns the preference, looks back, and sees the pilot take over."""
    expect(page.locator("#link")).to_have_text("live")
    expect(page.locator("#owner")).to_contain_text("operator")
    expect(figure(page, "Height")).to_have_text("60 m")
    page.get_by_role("button", name="Engage").click()
    expect(page.locator("#answer")).to_have_text("acknowledged: accepted")
    expect(page.locator("#owner")).to_have_text("Gleaner flies the mission")
    expect(page.locator("#attention tbody tr")).to_have_count(3 + 6 + 1)

    slider = page.get_by_label("Preference: weight of data")
    slider.focus()
    slider.press("Home")
    expect(page.locator("#answer")).to_have_text("acknowledged: accepted")
    expect(figure(page, "Preference")).to_have_text("0.00 data")
    page.get_by_role("button", name="data only").click()
    expect(figure(page, "Preference")).to_have_text("1.00 data")

    before = page.locator("#decision-words").inner_text()
    expect(page.locator("#decision-words")).not_to_have_text(before)
    page.wait_for_function("() => Page.flight.decisions.length > 25")
    if picture:
        page.screenshot(path=picture, full_page=True)

    page.get_by_label("Time").focus()
    page.keyboard.press("Home")
    expect(page.locator("#follow")).to_have_attribute("aria-pressed", "false")
    expect(figure(page, "Collected")).to_have_text("0.0 %")
    page.get_by_role("button", name="Live").click()

    page.get_by_role("button", name="pilot takes LOITER").click()
    expect(page.locator("#owner")).to_have_text("The pilot or a failsafe has the aircraft")


def check(program, picture):
    problems = []
    out = tempfile.mkdtemp()
    port = free_port()
    server = Server(program, port, out)
    server.start()
    try:
        with sync_playwright() as play:
            chromium = shutil.which("chromium") or shutil.which("chromium-browser")
            if not chromium:
                sys.exit("no chromium on the PATH: apt-get install chromium")
            browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.set_default_timeout(PATIENCE_MS)
            expect.set_options(timeout=PATIENCE_MS)
            restarting = False

            def note(text):
                if not restarting:
                    problems.append(text)

            page.on("console", lambda message: note(message.text) if message.type in ("error", "warning") else None)
            page.on("pageerror", lambda error: note(str(error)))
            address = f"http://127.0.0.1:{port}/"
            weight = len(open_page(page, address).body())
            fly(page, picture)

            violations = []
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                violations += [v for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]

            page.set_viewport_size({"width": 390, "height": 844})
            overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")

            restarting = True
            server.stop()
            expect(page.locator("#link")).not_to_have_text("live")
            server.start()
            expect(page.locator("#link")).to_have_text("live")
            expect(page.locator("#owner")).not_to_have_text("The pilot or a failsafe has the aircraft")
            browser.close()
    finally:
        server.stop()
        shutil.rmtree(out, ignore_errors=True)
    if problems:
        sys.exit(f"the console shows {problems}")
    if violations:
        sys.exit(f"axe finds {[(v['id'], v['nodes'][0]['html']) for v in violations]}")
    if overflow > 0:
        sys.exit(f"on a phone the page is {overflow} pixels too wide")
    return {"weight_bytes": weight, "serious_violations": len(violations), "overflow_px": overflow}


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    print(json.dumps(check(sys.argv[1], sys.argv[2] if len(sys.argv) == 3 else None)))
