#!/usr/bin/env python3
"""Writes what pymavlink makes of MAVLink, to be read and reproduced by the link crate's tests.

packets.txt: frames, one a line: name, hex. lengths_v1.txt: id and payload length of every MAVLink 1 message.
Needs pymavlink 2.4; the output is committed.
"""

import hashlib
import math
import os

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v10 import ardupilotmega as mavlink1  # noqa: E402
from pymavlink.dialects.v20 import ardupilotmega as mavlink2  # noqa: E402

VEHICLE = dict(srcSystem=42, srcComponent=1)
STATION = dict(srcSystem=255, srcComponent=190)
OWN = dict(srcSystem=42, srcComponent=191)
NAN = math.nan


def frame(message, srcSystem, srcComponent, seq=7, dialect=mavlink2, key=None, link_id=3, timestamp=123456789):
    mav = dialect.MAVLink(None, srcSystem=srcSystem, srcComponent=srcComponent)
    mav.seq = seq
    if key is not None:
        mav.signing.secret_key = key
        mav.signing.sign_outgoing = True
        mav.signing.link_id = link_id
        mav.signing.timestamp = timestamp
    return message.pack(mav)


m = mavlink2
text = lambda words, size: words.encode().ljust(size, b"\0")[:size]
channels = [1500, 1501, 1000, 1503, 1800, 0, 65535] + [1507] * 9 + [65535, 65535]
voltages = [12600] + [65535] * 9


def command_long(target, command, p1, confirmation=0):
    return m.MAVLink_command_long_message(*target, command, confirmation, p1, 0, 0, 0, 0, 0, 0)


received = [
    ("heartbeat_copter_guided", VEHICLE, m.MAVLink_heartbeat_message(2, 3, 0xD9, 4, 4, 3)),
    ("heartbeat_px4_offboard", VEHICLE, m.MAVLink_heartbeat_message(2, 12, 0x9D, 0x00060000, 5, 3)),
    ("heartbeat_of_the_future", VEHICLE, m.MAVLink_heartbeat_message(200, 99, 0x51, 77, 3, 3)),
    ("heartbeat_station", STATION, m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)),
    ("sys_status", VEHICLE, m.MAVLink_sys_status_message(
        0x5361FD2F, 0x5320D12F, 0x5761FD2F, 120, 12350, 2811, 87, 0, 0, 0, 0, 0, 0)),
    ("battery_status", VEHICLE, m.MAVLink_battery_status_message(
        0, 0, 1, 32767, voltages, 2811, 323, -1, 90, 0, 2)),
    ("battery_status_unknown", VEHICLE, m.MAVLink_battery_status_message(
        1, 0, 1, 32767, voltages, -1, -1, -1, -1, 0, 0)),
    ("local_position_ned", VEHICLE, m.MAVLink_local_position_ned_message(
        123456, 12.5, -34.25, -60.0, 1.5, -2.5, 0.25)),
    ("local_position_ned_nan", VEHICLE, m.MAVLink_local_position_ned_message(1, NAN, 0, 0, 0, 0, 0)),
    ("local_position_ned_inf", VEHICLE, m.MAVLink_local_position_ned_message(1, 0, 0, 0, 0, math.inf, 0)),
    ("global_position_int", VEHICLE, m.MAVLink_global_position_int_message(
        123456, 473977418, 85455938, 548030, 60010, 150, -250, 25, 35999)),
    ("global_position_int_off", VEHICLE, m.MAVLink_global_position_int_message(
        1, 900000001, 0, 0, 0, 0, 0, 0, 0)),
    ("home_position", VEHICLE, m.MAVLink_home_position_message(
        473977418, 85455938, 488030, 1.0, 2.0, -0.5, [1, 0, 0, 0], 0, 0, 0, 1000000)),
    ("home_position_no_local", VEHICLE, m.MAVLink_home_position_message(
        473977418, 85455938, 488030, NAN, NAN, NAN, [1, 0, 0, 0], 0, 0, 0, 0)),
    ("gps_global_origin", VEHICLE, m.MAVLink_gps_global_origin_message(473977418, -85455938, 488000, 5)),
    ("ekf_status_report", VEHICLE, m.MAVLink_ekf_status_report_message(831, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)),
    ("estimator_status", VEHICLE, m.MAVLink_estimator_status_message(
        123456000, 831, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.3, 0.4)),
    ("extended_sys_state", VEHICLE, m.MAVLink_extended_sys_state_message(0, 2)),
    ("rc_channels", VEHICLE, m.MAVLink_rc_channels_message(123456, 16, *channels, 255)),
    ("command_user_1", STATION, command_long((42, 191), 31010, 0.75)),
    ("command_user_1_nan", STATION, command_long((42, 191), 31010, NAN)),
    ("command_user_2_resent", STATION, command_long((42, 0), 31011, 1, confirmation=2)),
    ("command_unknown_to_the_dialect", STATION, command_long((42, 191), 54321, 1)),
    ("command_int_user_3", STATION, m.MAVLink_command_int_message(
        42, 191, 0, 31012, 0, 0, 1.5, 2.5, 3.5, 4.5, -7, 8, 9.5)),
    ("command_ack_from_autopilot", VEHICLE, m.MAVLink_command_ack_message(21, 0, 0, 0, 42, 191)),
    ("param_request_list", STATION, m.MAVLink_param_request_list_message(42, 191)),
    ("param_request_read_index", STATION, m.MAVLink_param_request_read_message(42, 191, b"", 3)),
    ("param_request_read_name", STATION, m.MAVLink_param_request_read_message(42, 191, b"GLN_BAT_UNITS", -1)),
    ("param_set", STATION, m.MAVLink_param_set_message(42, 191, b"GLN_ALT", 75.5, 9)),
    ("param_set_16_characters", STATION, m.MAVLink_param_set_message(42, 191, b"ABCDEFGHIJKLMNOP", 1.0, 9)),
    ("statustext", VEHICLE, m.MAVLink_statustext_message(4, b"Battery 1 is low 10.30V used 323 mAh", 0, 0)),
    ("timesync_request", VEHICLE, m.MAVLink_timesync_message(0, 987654321012)),
    ("timesync_answer", VEHICLE, m.MAVLink_timesync_message(5, 987654321012)),
    ("tunnel_radio_report", STATION, m.MAVLink_tunnel_message(
        42, 191, 40000, 13, list(bytes([0xAC, 2, 0, 0, 0x20, 0x40, 1, 0, 0, 0x7A, 0x44, 0xFA, 1])) + [0] * 115)),
    ("attitude_not_needed", VEHICLE, m.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0, 0, 0)),
]

sent = [
    ("own_heartbeat", m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)),
    ("own_position_target", m.MAVLink_set_position_target_local_ned_message(
        2000, 42, 1, 1, 3576, 12.5, -34.25, -60.0, 0, 0, 0, 0, 0, 0, 0, 0)),
    ("own_position_velocity_target", m.MAVLink_set_position_target_local_ned_message(
        2000, 42, 1, 1, 3520, 12.5, -34.25, -60.0, 1.5, -2.5, 0.25, 0, 0, 0, 0, 0)),
    ("own_land", command_long((42, 1), 21, 0)),
    ("own_return_resent", command_long((42, 1), 20, 0, confirmation=1)),
    ("own_hold_copter", m.MAVLink_command_long_message(42, 1, 176, 0, 1, 17, 0, 0, 0, 0, 0)),
    ("own_hold_px4", m.MAVLink_command_long_message(42, 1, 176, 0, 1, 4, 3, 0, 0, 0, 0)),
    ("own_change_speed", m.MAVLink_command_long_message(42, 1, 178, 0, 1, 12.5, -1, 0, 0, 0, 0)),
    ("own_interval_position", m.MAVLink_command_long_message(42, 1, 511, 0, 32, 100000, 0, 0, 0, 0, 0)),
    ("own_request_origin", m.MAVLink_command_long_message(42, 1, 512, 0, 49, 0, 0, 0, 0, 0, 0)),
    ("own_ack_accepted", m.MAVLink_command_ack_message(31010, 0, 0, 0, 255, 190)),
    ("own_ack_denied", m.MAVLink_command_ack_message(31010, 2, 0, 0, 255, 190)),
    ("own_ack_unsupported", m.MAVLink_command_ack_message(54321, 3, 0, 0, 255, 190)),
    ("own_param_value_alt", m.MAVLink_param_value_message(b"GLN_ALT", 75.5, 9, 11, 2)),
    ("own_param_value_reserve", m.MAVLink_param_value_message(b"GLN_RESERVE", 2.0, 9, 11, 4)),
    ("own_named_value", m.MAVLink_named_value_float_message(2000, text("spare_bat", 10), 37.5)),
    ("own_text", m.MAVLink_statustext_message(6, text("engaged", 50), 0, 0)),
    ("own_text_chunk_0", m.MAVLink_statustext_message(4, b"0123456789" * 5, 1, 0)),
    ("own_text_chunk_1", m.MAVLink_statustext_message(4, text("the end", 50), 1, 1)),
    ("own_tunnel_decision", m.MAVLink_tunnel_message(0, 0, 40001, 5, [1, 0, 3, 0, 0] + [0] * 123)),
    ("own_autopilot_version", m.MAVLink_autopilot_version_message(
        8 | 8192, 0x000100FF, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0, [0] * 18)),
]

FOLDER = os.path.dirname(os.path.abspath(__file__))
with open(os.path.join(FOLDER, "lengths_v1.txt"), "w") as out:
    out.write("# Made by make_golden.py with pymavlink. Id, payload bytes.\n")
    for number, kind in sorted(mavlink1.mavlink_map.items()):
        if 0 <= number < 256:
            out.write(f"{number} {kind.unpacker.size}\n")

with open(os.path.join(FOLDER, "packets.txt"), "w") as out:
    out.write("# Made by make_golden.py with pymavlink. Frames: name, hex.\n")
    for name, who, message in received:
        out.write(f"{name} {frame(message, **who).hex()}\n")
    for name, message in sent:
        out.write(f"{name} {frame(message, **OWN, seq=0).hex()}\n")
    v1 = mavlink1.MAVLink_local_position_ned_message(123456, 12.5, -34.25, -60.0, 1.5, -2.5, 0.25)
    out.write(f"v1_local_position_ned {frame(v1, **VEHICLE, dialect=mavlink1).hex()}\n")
    v1 = mavlink1.MAVLink_command_ack_message(21, 4)
    out.write(f"v1_command_ack {frame(v1, **VEHICLE, dialect=mavlink1).hex()}\n")
    key = hashlib.sha256(b"golden").digest()
    signed = m.MAVLink_heartbeat_message(2, 3, 0xD9, 4, 4, 3)
    out.write(f"signed_heartbeat {frame(signed, **VEHICLE, key=key).hex()}\n")
    out.write(f"signed_heartbeat_later {frame(signed, **VEHICLE, key=key, timestamp=123456800).hex()}\n")
    out.write(f"signed_unknown_link {frame(signed, **VEHICLE, key=key, link_id=9).hex()}\n")
    setup = m.MAVLink_setup_signing_message(42, 191, list(range(32)), 1)
    out.write(f"signed_setup_signing {frame(setup, **STATION, key=key).hex()}\n")
