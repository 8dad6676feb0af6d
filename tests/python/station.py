"""A ground station made of pymavlink: what the judges in this folder share."""

import sys
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mav

VEHICLE = 1
AUTOPILOT = 1
GLEANER = 191
GUIDED = 4
LOITER = 5
RTL = 6
DECISION = 40001
NAN = float("nan")
# How long anything may take, wall time. The simulation may run faster than the wall, never slower.
PATIENCE_S = 60


class Station:
    def __init__(self, connection):
        self.link = mavutil.mavlink_connection(connection, source_system=255, source_component=190)
        self.decisions = 0
        self.texts = []
        self.heartbeat_sent = 0.0

    def receive(self):
        """The next message, or None. Sends our heartbeat, counts Gleaner's decisions and keeps its texts."""
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
        sys.exit(f"waited {PATIENCE_S} s for {what}; Gleaner sent {self.texts[-5:]}")

    def command(self, component, command, *parameters):
        """Sends a command until it is acknowledged, as ground stations do; returns the result."""
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
        """Sends PARAM_SET; returns the value in the answer."""
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


def px4_mode(main, sub=0):
    """PX4's custom_mode: main mode in bits 16..23, sub mode in bits 24..31."""
    return main << 16 | sub << 24


OFFBOARD = px4_mode(6)
HOLD = px4_mode(4, 3)


def set_px4_mode(station, mode):
    return station.command(AUTOPILOT, mav.MAV_CMD_DO_SET_MODE, 1, mode >> 16 & 255, mode >> 24)


def take_off_px4(station, altitude_m):
    """Take-off to an altitude above the ground (the command takes one above sea level), then HOLD."""
    accepted = mav.MAV_RESULT_ACCEPTED
    deadline = time.monotonic() + PATIENCE_S
    home_m = station.wait(
        "the altitude above sea level", lambda m: m.get_type() == "GLOBAL_POSITION_INT", component=AUTOPILOT
    ).alt / 1000
    while station.command(AUTOPILOT, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) != accepted:
        expect(time.monotonic() < deadline, "the autopilot does not arm")
    takeoff = station.command(AUTOPILOT, mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, NAN, NAN, home_m + altitude_m)
    expect(takeoff == accepted, f"take-off gave result {takeoff}")
    station.wait(
        "the altitude",
        lambda m: m.get_type() == "GLOBAL_POSITION_INT" and m.relative_alt / 1000 > altitude_m - 0.5,
        component=AUTOPILOT,
    )
    expect(set_px4_mode(station, HOLD) == accepted, "HOLD was refused")


def enter_offboard(station):
    """PX4 refuses OFFBOARD until targets are streamed."""
    deadline = time.monotonic() + PATIENCE_S
    while set_px4_mode(station, OFFBOARD) != mav.MAV_RESULT_ACCEPTED:
        expect(time.monotonic() < deadline, "OFFBOARD was refused")


def named_value(name, value):
    return lambda m: m.get_type() == "NAMED_VALUE_FLOAT" and m.name == name and abs(m.value - value) < 1e-6
