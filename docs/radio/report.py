"""Encodes one radio report for Gleaner's serial port. Standard library only; see docs/radio.md.

usage: report.py DEVICE SNR_DB REMAINING|- AGE_MS     writes one frame to standard output
"""

import struct
import sys


def varint(value):
    encoded = bytearray()
    while value >= 0x80:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


def crc16(data):
    """CRC-16/IBM-SDLC."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0x8408 if crc & 1 else crc >> 1
    return crc ^ 0xFFFF


def cobs(data):
    """Replaces each zero by the distance to the next one. For data shorter than 254 bytes."""
    return b"".join(bytes([len(run) + 1]) + run for run in data.split(b"\0"))


def report(device, snr_db, remaining, age_ms):
    """One frame; `remaining` is None when the device does not report it."""
    body = varint(device) + struct.pack("<f", snr_db)
    body += b"\0" if remaining is None else b"\1" + struct.pack("<f", remaining)
    body += varint(age_ms)
    return b"\0" + cobs(body + struct.pack("<H", crc16(body))) + b"\0"


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    device, snr_db, remaining, age_ms = sys.argv[1:]
    remaining = None if remaining == "-" else float(remaining)
    sys.stdout.buffer.write(report(int(device), float(snr_db), remaining, int(age_ms)))
