"""A browser on the page: the live page of a simulated flight, a finished flight, a mission.

usage: browser.py GLEANER_SITL GLEANER [PICTURES]

GLEANER_SITL and GLEANER are the programs; they are started here, because one check restarts the server. PICTURES is a
folder for screenshots. Prints one JSON object with what was seen; exits with 1 and a line on stderr at the first thing
that is wrong.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect, sync_playwright

# Limit for anything that the page must show, wall time.
PATIENCE_MS = 90_000
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]
DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}


class Server:
    """`gleaner-sitl serve` with the pilot inside, five times as fast as the wall clock."""

    def __init__(self, program, folder):
        self.program = program
        self.folder = folder
        self.port = 0
        self.process = None

    def start(self):
        """Returns the page's address. A second start takes the same port."""
        self.process = subprocess.Popen(
            [
                self.program, "serve", "--onboard", "--auto-takeoff", "--seed", "3", "--speed", "5",
                "--gcs", "udpin:127.0.0.1:0", "--http", f"127.0.0.1:{self.port}",
                "--out", f"{self.folder}/served",
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        for line in self.process.stdout:
            if line.startswith("page "):
                address = line.split()[1]
                self.port = int(address.rstrip("/").rsplit(":", 1)[1])
                return address
        sys.exit("the server ended before it printed the page's address")

    def stop(self):
        if self.process:
            self.process.terminate()
            self.process.communicate()
            self.process = None


class Viewer:
    """One tab, with everything that its console complains about."""

    def __init__(self, browser):
        self.page = browser.new_page(viewport=DESKTOP)
        self.page.set_default_timeout(PATIENCE_MS)
        self.problems = []
        self.listening = True
        self.page.on("console", self.note_console)
        self.page.on("pageerror", lambda error: self.note(str(error)))

    def note_console(self, message):
        if message.type in ("error", "warning"):
            self.note(message.text)

    def note(self, text):
        if self.listening:
            self.problems.append(text)

    def figure(self, name):
        """The value beside a name in the panel of figures."""
        return self.page.locator("#figures div", has=self.page.locator("dt", has_text=name)).locator("dd")

    def photograph(self, what, pictures):
        """The upper part, and the whole page in both colour schemes and on a phone."""
        upper = {"x": 0, "y": 0, "width": DESKTOP["width"], "height": 1430}
        if self.page.evaluate("document.documentElement.scrollHeight") >= upper["height"]:
            self.page.screenshot(path=pictures / f"{what}.png", full_page=True, clip=upper)
        for scheme in ("dark", "light"):
            self.page.emulate_media(color_scheme=scheme)
            self.page.screenshot(path=pictures / f"{what}-{scheme}.png", full_page=True)
        self.page.set_viewport_size(PHONE)
        self.page.screenshot(path=pictures / f"{what}-phone.png", full_page=True)
        self.page.set_viewport_size(DESKTOP)

    def judge(self, what):
        """Accessibility in both colour schemes, width on a phone, and silence of the console."""
        for scheme in ("light", "dark"):
            self.page.emulate_media(color_scheme=scheme)
            found = Axe().run(self.page).response["violations"]
            serious = [(v["id"], v["nodes"][0]["html"]) for v in found if v["impact"] in ("serious", "critical")]
            if serious:
                sys.exit(f"{what}, {scheme}: axe finds {serious}")
        self.page.emulate_media(color_scheme="light")
        self.page.set_viewport_size(PHONE)
        overflow = self.page.evaluate("document.documentElement.scrollWidth - innerWidth")
        if overflow > 0:
            sys.exit(f"{what}: on a phone the page is {overflow} pixels too wide")
        self.page.set_viewport_size(DESKTOP)
        if self.problems:
            sys.exit(f"{what}: the console shows {self.problems}")


def fly(viewer, pictures):
    """Engages, changes the preference, looks back, and sees the pilot take over."""
    page = viewer.page
    expect(page.locator("#link")).to_have_text("live")
    expect(page.locator("#owner")).to_contain_text("operator")
    expect(viewer.figure("Height")).to_have_text("60 m")
    page.get_by_role("button", name="data only").click()
    expect(viewer.figure("Preference")).to_have_text("1.00 data")
    page.get_by_role("button", name="Engage").click()
    expect(page.locator("#answer")).to_have_text("acknowledged: accepted")
    expect(page.locator("#owner")).to_have_text("Gleaner flies the mission")
    expect(page.locator("#attention tbody tr")).to_have_count(3 + 6 + 1)

    # Live: one decision follows the other, and the forecasts follow the decisions.
    before = page.locator("#decision-words").inner_text()
    expect(page.locator("#decision-words")).not_to_have_text(before)
    expect(page.locator("#what-if .card")).to_have_count(5)
    if pictures:
        page.wait_for_function("() => Page.flight.decisions.length > 25")
        viewer.photograph("live", pictures)

    # The slider changes what the aircraft does: for energy alone each decision is a move towards the terminal.
    slider = page.get_by_label("Preference: weight of data")
    slider.focus()
    slider.press("Home")
    expect(page.locator("#answer")).to_have_text("acknowledged: accepted")
    expect(viewer.figure("Preference")).to_have_text("0.00 data")
    page.evaluate(
        """() => { window.switched = () => {
          const text = Page.flight.texts.find((text) => text.text.includes("preference w_data 0.00"));
          return text ? Page.flight.decisions.filter((decision) => decision.t_s > text.t_s) : [];
        }; }"""
    )
    page.wait_for_function("() => window.switched().length >= 6")
    page.get_by_role("button", name="pilot takes LOITER").click()
    expect(page.locator("#owner")).to_have_text("The pilot or a failsafe has the aircraft")
    expect(page.locator("#reason")).to_contain_text("Taken over")
    distances = page.evaluate(
        """() => window.switched().map(({ cell }) =>
          Math.abs(cell[0] - Page.flight.scene.terminal[0]) + Math.abs(cell[1] - Page.flight.scene.terminal[1]))"""
    )
    if any(later >= earlier for earlier, later in zip(distances, distances[1:])):
        sys.exit(f"at w = 0 the aircraft does not head for the terminal: distances {distances}")

    # Back in time, and to the present.
    page.get_by_role("slider", name="Time").press("Home")
    expect(page.locator("#follow")).to_have_attribute("aria-pressed", "false")
    expect(viewer.figure("Collected")).to_have_text("0.0 %")
    page.get_by_role("button", name="Live").click()
    expect(page.locator("#follow")).to_have_attribute("aria-pressed", "true")
    viewer.judge("live")


def restart(viewer, server):
    """The page finds the program again by itself."""
    page = viewer.page
    # A lost connection stands in the console; that is no fault of the page.
    viewer.listening = False
    server.stop()
    expect(page.locator("#link")).not_to_have_text("live")
    server.start()
    expect(page.locator("#link")).to_have_text("live")
    expect(page.locator("#owner")).not_to_have_text("The pilot or a failsafe has the aircraft")
    viewer.listening = True


def finished(viewer, path, pictures):
    """A flight in a file: no server, no controls."""
    page = viewer.page
    page.goto(path.as_uri())
    expect(page.locator("#link")).to_have_text("finished flight")
    expect(page.locator("#controls")).to_be_hidden()
    scrubber = page.get_by_role("slider", name="Time")
    scrubber.evaluate("(node) => { node.value = (Page.flight.start + Page.flight.end) / 2; }")
    scrubber.dispatch_event("input")
    expect(page.locator("#attention tbody tr")).to_have_count(3 + 6 + 1)
    expect(page.locator("#what-if .card")).to_have_count(5)
    if pictures:
        viewer.photograph("flight", pictures)
    viewer.judge("flight")


def planned(viewer, path, pictures):
    """A mission in a file: the city and the devices, with the line of sight of the one that is chosen."""
    page = viewer.page
    page.goto(path.as_uri())
    expect(page.locator("#link")).to_have_text("mission")
    expect(page.locator("#devices tbody tr")).to_have_count(6)
    expect(page.locator("#decision-words")).to_be_hidden()
    page.get_by_label("Line of sight to").select_option(index=1)
    if pictures:
        viewer.photograph("mission", pictures)
    viewer.judge("mission")


def check(sitl, gleaner, pictures):
    folder = pathlib.Path(tempfile.mkdtemp())
    flight, report, plan, mission = (
        folder / name for name in ("flight.html", "report.html", "plan.html", "mission.toml")
    )
    server = Server(sitl, folder)
    try:
        fly_order = [sitl, "fly", "--seed", "3", "--mission-out", mission, "--html", flight, "--out", folder / "flown"]
        subprocess.run(fly_order, check=True, stdout=subprocess.DEVNULL)
        show = [gleaner, "mission", "show", mission, "--html", plan]
        subprocess.run(show, check=True, stdout=subprocess.DEVNULL)
        write = [gleaner, "report", folder / "flown", "--mission", mission, "--html", report]
        subprocess.run(write, check=True, stdout=subprocess.DEVNULL)
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        if not chromium:
            sys.exit("no chromium on the PATH: apt-get install chromium")
        with sync_playwright() as play:
            expect.set_options(timeout=PATIENCE_MS)
            browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
            viewer = Viewer(browser)
            live_bytes = len(viewer.page.goto(server.start()).body())
            fly(viewer, pictures)
            restart(viewer, server)
            finished(Viewer(browser), flight, pictures)
            finished(Viewer(browser), report, None)
            planned(Viewer(browser), plan, pictures)
            browser.close()
        return {
            "live_bytes": live_bytes,
            "flight_bytes": flight.stat().st_size,
            "report_bytes": report.stat().st_size,
            "mission_bytes": plan.stat().st_size,
        }
    finally:
        server.stop()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    print(json.dumps(check(sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]) if len(sys.argv) == 4 else None)))
