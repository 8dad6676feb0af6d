"""A ground station made of pymavlink: engages Gleaner, turns its preference in flight, takes over.

usage: ground_station.py CONNECTION

CONNECTION is pymavlink's, for example udpout:127.0.0.1:14550. Prints one JSON object with what was seen; exits
with 1 and a line on stderr at the first thing that is not as the MAVLink contract says.
"""

import json
import math
import sys
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mav

VEHICLE = 1
AUTOPILOT = 1
GLEANER = 191
GUIDED = 4
LOITER = 5
DECISION = 40001
PARAMETERS = {
    "GLN_W_DATA", "GLN_ENABLE", "GLN_ALT", "GLN_SPEED", "GLN_RESERVE", "GLN_BAT_UNITS", "GLN_ARRIVE_R",
    "GLN_SNR_AGE", "GLN_W_RC",
}
# How long anything may take, wall time. The simulation may run faster than the wall, never slower.
PATIENCE_S = 60


class Station:
    def __init__(self, connection):
        self.link = mavutil.mavlink_connection(connection, source_system=255, source_component=190)
        self.decisions = 0
        self.texts = []
        self.heartbeat_sent = 0.0

    def receive(self):
        """The next message, or None; keeps our heartbeat going and counts what Gleaner decides and says."""
        now = time.monotonic()
        if now - self.heartbeat_sent > 0.5:
            self.heartbeat_sent = now
            self.link.mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        message = self.link.recv_match(blocking=True, timeout=0.2)
        if message is not None and message.get_srcComponent() == GLEANER:
            if message.get_type() == "TUNNEL" and message.payload_type == DECISION:
                self.decisions += 1
            if message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)
        return message

    def wait(self, what, wanted, component=GLEANER):
        """The first message from `component` that `wanted` accepts."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            message = self.receive()
            if message is not None and message.get_srcComponent() == component and wanted(message):
                return message
        sys.exit(f"waited {PATIENCE_S} s for {what}; Gleaner said {self.texts[-5:]}")

    def command(self, component, command, *parameters):
        """Sends a command until it is acknowledged, as ground stations do; gives the result."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        for confirmation in range(5):
            self.link.mav.command_long_send(VEHICLE, component, command, confirmation, *values)
            deadline = time.monotonic() + 2
            while time.monotonic() < deadline:
                message = self.receive()
                if (
                    message is not None
                    and message.get_type() == "COMMAND_ACK"
                    and message.get_srcComponent() == component
                    and message.command == command
                ):
                    return message.result
        sys.exit(f"command {command} to component {component} was never acknowledged")

    def set_parameter(self, name, value):
        """PARAM_SET; gives the value that the answer carries."""
        self.link.mav.param_set_send(VEHICLE, GLEANER, name.encode(), value, mav.MAV_PARAM_TYPE_REAL32)
        return self.wait(
            f"the answer to PARAM_SET {name}",
            lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name,
        ).param_value

    def wait_for_decisions(self, count):
        goal = self.decisions + count
        self.wait(f"{count} decisions", lambda m: self.decisions >= goal)

    def wait_for_mode(self, mode):
        self.wait(
            f"mode {mode}",
            lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == mode,
            component=AUTOPILOT,
        )


def expect(condition, what):
    if not condition:
        sys.exit(what)


def read_parameters(station):
    station.link.mav.param_request_list_send(VEHICLE, GLEANER)
    values = {}

    def collect(message):
        if message.get_type() == "PARAM_VALUE":
            expect(message.param_type == mav.MAV_PARAM_TYPE_REAL32, f"{message.param_id} is not REAL32")
            expect(message.param_count == len(PARAMETERS), f"param_count is {message.param_count}")
            values[message.param_id] = message.param_value
        return set(values) >= PARAMETERS

    station.wait("all parameters", collect)
    expect(set(values) == PARAMETERS, f"parameters are {sorted(values)}")
    return values


def refuse_bad_values(station):
    before = station.set_parameter("GLN_W_DATA", 0.75)
    expect(before == 0.75, f"GLN_W_DATA 0.75 came back as {before}")
    for bad in (math.nan, -1.0, 2.0):
        said = len(station.texts)
        after = station.set_parameter("GLN_W_DATA", bad)
        expect(after == before, f"GLN_W_DATA {bad} was answered with {after}, not with the old {before}")
        station.wait(f"a text that refuses {bad}", lambda m: len(station.texts) > said)
        result = station.command(GLEANER, mav.MAV_CMD_USER_1, bad)
        expect(result == mav.MAV_RESULT_DENIED, f"MAV_CMD_USER_1 with {bad} gave result {result}")
    echo = station.set_parameter("GLN_W_DATA", before)
    expect(echo == before, "a refused value changed something")


def take_off(station, altitude_m):
    accepted = mav.MAV_RESULT_ACCEPTED
    deadline = time.monotonic() + PATIENCE_S
    expect(station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, GUIDED) == accepted, "GUIDED was refused")
    # Arming fails until the estimator has a position.
    while station.command(AUTOPILOT, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) != accepted:
        expect(time.monotonic() < deadline, "the autopilot does not arm")
    takeoff = station.command(AUTOPILOT, mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, altitude_m)
    expect(takeoff == accepted, f"take-off gave result {takeoff}")
    interval = station.command(
        AUTOPILOT, mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 100_000
    )
    expect(interval == accepted, "the autopilot streams no position")
    station.wait(
        "the altitude",
        lambda m: m.get_type() == "LOCAL_POSITION_NED" and -m.z > altitude_m - 0.5,
        component=AUTOPILOT,
    )


def named_value(name, value):
    return lambda m: m.get_type() == "NAMED_VALUE_FLOAT" and m.name == name and abs(m.value - value) < 1e-6


def main(connection):
    station = Station(connection)
    # Until a station speaks, nothing may know where it is.
    beat = station.wait("Gleaner's heartbeat", lambda m: m.get_type() == "HEARTBEAT")
    expect(beat.type == mav.MAV_TYPE_ONBOARD_CONTROLLER, f"type is {beat.type}")
    expect(beat.autopilot == mav.MAV_AUTOPILOT_INVALID, f"autopilot is {beat.autopilot}")
    expect(beat.get_srcSystem() == VEHICLE, "Gleaner did not take over the vehicle's system id")

    values = read_parameters(station)
    refuse_bad_values(station)
    take_off(station, values["GLN_ALT"])

    expect(station.set_parameter("GLN_W_DATA", 1.0) == 1.0, "w = 1 was not taken")
    engaged = station.command(GLEANER, mav.MAV_CMD_USER_2, 1)
    expect(engaged == mav.MAV_RESULT_ACCEPTED, f"engage gave result {engaged}")
    station.wait_for_decisions(10)

    switched = station.command(GLEANER, mav.MAV_CMD_USER_1, 0.0)
    expect(switched == mav.MAV_RESULT_ACCEPTED, f"preference by command gave result {switched}")
    station.wait("the telemetry of w = 0", named_value("w_data", 0.0))
    station.wait_for_decisions(6)

    expect(station.set_parameter("GLN_W_DATA", 0.25) == 0.25, "w = 0.25 was not taken in flight")
    station.wait("the telemetry of w = 0.25", named_value("w_data", 0.25))
    station.wait_for_decisions(2)
    before_takeover = station.decisions

    # The pilot takes over, then gives GUIDED back without asking Gleaner for anything.
    result = station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, LOITER)
    expect(result == mav.MAV_RESULT_ACCEPTED, "LOITER was refused")
    station.wait_for_mode(LOITER)
    beats = 0

    def three_beats(message):
        nonlocal beats
        beats += message.get_type() == "HEARTBEAT"
        return beats >= 3

    station.wait("Gleaner's heartbeats after the take-over", three_beats)
    settled = station.decisions
    result = station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, GUIDED)
    expect(result == mav.MAV_RESULT_ACCEPTED, "GUIDED was refused")
    station.wait_for_mode(GUIDED)
    beats = 0
    station.wait("Gleaner's heartbeats after GUIDED came back", three_beats)
    expect(station.decisions == settled, "Gleaner decided after the pilot had taken over")
    expect(settled <= before_takeover + 1, "Gleaner went on after the take-over")

    print(json.dumps({"parameters": values, "decisions": station.decisions, "texts": station.texts}))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
