"""Uses the ground-station kit as its users do: every action of the QGroundControl file, and the MAVProxy module.

usage: kit_station.py CONNECTION KIT

KIT is the folder with gleaner.MavlinkActions.json and mavproxy_gleaner.py. MAVProxy holds the connection; the actions are
sent through it. Prints one JSON object with what was seen; exits with 1 and a line on stderr at the first difference.
"""

import json
import os
import pathlib
import sys
import tempfile

from pymavlink.dialects.v20 import ardupilotmega as mav

from mavproxy_station import Console, free_port
from station import GLEANER, Station, expect, named_value

# QGroundControl ignores a file with any other key.
FILE_KEYS = {"version", "fileType", "actions"}
ACTION_KEYS = {"label", "description", "mavCmd", "compId", *(f"param{number}" for number in range(1, 8))}


def press(station, action):
    """Sends one action as QGroundControl does; the result."""
    expect(set(action) <= ACTION_KEYS, f"{action['label']}: keys {sorted(set(action) - ACTION_KEYS)}")
    expect(action["compId"] == GLEANER, f"{action['label']} goes to component {action['compId']}")
    parameters = [action.get(f"param{number}", 0.0) for number in range(1, 8)]
    return station.command(action["compId"], action["mavCmd"], *parameters)


def press_all(station, path):
    """Every button once, on the ground. Off is pressed again at the end."""
    kit = json.loads(path.read_text())
    expect(set(kit) == FILE_KEYS and kit["fileType"] == "MavlinkActions", f"the file has keys {sorted(kit)}")
    results = {}
    off = None
    for action in kit["actions"]:
        label = action["label"]
        results[label] = press(station, action)
        returns = action["mavCmd"] == mav.MAV_CMD_USER_3
        wanted = mav.MAV_RESULT_DENIED if returns else mav.MAV_RESULT_ACCEPTED
        expect(results[label] == wanted, f"{label} gave result {results[label]}")
        if action["mavCmd"] == mav.MAV_CMD_USER_1:
            station.wait(f"the preference of {label}", named_value("w_data", action["param1"]))
        if action["mavCmd"] == mav.MAV_CMD_USER_2 and action["param1"] == 0:
            off = action
    expect(off is not None, "there is no button that ends a request")
    press(station, off)
    return results


def type_all(console, station):
    """The commands of the module."""
    console.type("module load mavproxy_gleaner")
    console.type("gleaner w 0.125")
    station.wait("the preference by the module", named_value("w_data", 0.125))
    for command, text in [("engage", "gleaner: waiting"), ("off", "gleaner: idle"), ("shadow", "gleaner: shadow")]:
        console.type(f"gleaner {command}")
        station.wait(
            f"the text after {command}",
            lambda m, text=text: m.get_type() == "STATUSTEXT" and m.text.startswith(text),
        )
    console.type("gleaner off")
    console.type("gleaner status")
    station.wait("a heartbeat", lambda m: "w_data     0.125" in console.printed())


def main(connection, kit):
    kit = pathlib.Path(kit).resolve()
    os.environ["PYTHONPATH"] = str(kit)
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        station = Station(f"udpin:127.0.0.1:{port}")
        console = Console(connection, f"udpout:127.0.0.1:{port}", folder)
        try:
            station.wait("Gleaner's heartbeat through MAVProxy", lambda m: m.get_type() == "HEARTBEAT")
            results = press_all(station, kit / "gleaner.MavlinkActions.json")
            type_all(console, station)
        except SystemExit as cause:
            sys.exit(f"{cause}\nMAVProxy printed: {console.printed()[-2000:]}")
        finally:
            console.close()
        print(json.dumps({"results": results, "texts": station.texts}))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
