"""Drives MAVProxy as its users do: selects component 191, sets the preference, engages, takes over.

usage: mavproxy_station.py CONNECTION

MAVProxy holds the connection and forwards everything to an observer here, which also flies the take-off. Prints one JSON
object with what was seen; exits with 1 and a line on stderr at the first difference.
"""

import json
import pathlib
import socket
import subprocess
import sys
import tempfile

from pymavlink.dialects.v20 import ardupilotmega as mav

from station import LOITER, Station, expect, named_value, take_off


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Console:
    """MAVProxy's prompt."""

    def __init__(self, connection, out, folder):
        script = pathlib.Path(sys.executable).parent / "mavproxy.py"
        modules = "link,param,cmdlong,mode,arm,misc,output"
        self.log = open(pathlib.Path(folder) / "console.txt", "w+")
        self.process = subprocess.Popen(
            [sys.executable, script, f"--master={connection}", f"--out={out}", "--streamrate=-1",
             f"--default-modules={modules}", f"--state-basedir={folder}"],
            stdin=subprocess.PIPE, stdout=self.log, stderr=subprocess.STDOUT, text=True, cwd=folder,
        )

    def type(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def printed(self):
        self.log.flush()
        return pathlib.Path(self.log.name).read_text()

    def close(self):
        self.process.kill()
        self.process.wait()


def fly(console, station):
    station.wait("Gleaner's heartbeat through MAVProxy", lambda m: m.get_type() == "HEARTBEAT")
    take_off(station, 60)

    console.type("vehicle 1:191")
    console.type("param fetch")
    station.wait("a parameter", lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == "GLN_W_DATA")
    # MAVProxy sets parameters that it knows only, so the whole list must have arrived.
    station.wait("the last parameter", lambda m: m.get_type() == "PARAM_VALUE" and m.param_index == m.param_count - 1)
    console.type("param set GLN_W_DATA 0.75")
    station.wait("the preference set by MAVProxy", named_value("w_data", 0.75))

    console.type("long MAV_CMD_USER_2 1")
    station.wait_for_decisions(2)
    console.type("long MAV_CMD_USER_1 0.25")
    station.wait("the preference by command", named_value("w_data", 0.25))
    station.wait_for_decisions(1)

    console.type("vehicle 1:1")
    console.type("mode LOITER")
    station.wait_for_mode(LOITER)
    station.wait("the take-over's text", lambda m: m.get_type() == "STATUSTEXT" and "passive" in m.text)
    decisions = station.decisions
    beats = 0

    def three_beats(message):
        nonlocal beats
        beats += message.get_type() == "HEARTBEAT"
        return beats >= 3

    station.wait("three heartbeats", three_beats)
    expect(station.decisions == decisions, "Gleaner decided after MAVProxy took over")


def main(connection):
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        station = Station(f"udpin:127.0.0.1:{port}")
        console = Console(connection, f"udpout:127.0.0.1:{port}", folder)
        try:
            fly(console, station)
        except SystemExit as cause:
            sys.exit(f"{cause}\nMAVProxy printed: {console.printed()[-2000:]}")
        finally:
            console.close()
        print(json.dumps({"decisions": station.decisions, "texts": station.texts}))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
