/* Encodes one radio report for Gleaner's serial port. C99, no heap, no library; see docs/radio.md.
 *
 * usage: report DEVICE SNR_DB REMAINING|- AGE_MS     writes one frame to standard output
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BODY_BYTES 19
#define FRAME_BYTES (1 + 1 + BODY_BYTES + 2 + 1)

static size_t put_varint(uint8_t *to, uint32_t value)
{
    size_t length = 0;
    while (value >= 0x80) {
        to[length++] = (uint8_t)(value | 0x80);
        value >>= 7;
    }
    to[length++] = (uint8_t)value;
    return length;
}

static size_t put_f32(uint8_t *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 4; i++)
        to[i] = (uint8_t)(bits >> (8 * i));
    return 4;
}

/* CRC-16/IBM-SDLC. */
static uint16_t crc16(const uint8_t *bytes, size_t length)
{
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < length; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 1 ? (crc >> 1) ^ 0x8408 : crc >> 1);
    }
    return (uint16_t)~crc;
}

/* Writes one frame; `remaining` is NULL when the device does not report it. Returns the frame's length. */
size_t gleaner_report(uint8_t frame[FRAME_BYTES], uint32_t device, float snr_db, const float *remaining,
                      uint32_t age_ms)
{
    uint8_t body[BODY_BYTES + 2];
    size_t length = put_varint(body, device);
    length += put_f32(body + length, snr_db);
    body[length++] = remaining != NULL;
    if (remaining != NULL)
        length += put_f32(body + length, *remaining);
    length += put_varint(body + length, age_ms);
    uint16_t crc = crc16(body, length);
    body[length++] = (uint8_t)crc;
    body[length++] = (uint8_t)(crc >> 8);

    /* COBS: each zero is replaced by the distance to the next one. */
    size_t at = 0;
    frame[at++] = 0;
    size_t code = at++;
    for (size_t i = 0; i < length; i++) {
        if (body[i] == 0) {
            frame[code] = (uint8_t)(at - code);
            code = at++;
        } else {
            frame[at++] = body[i];
        }
    }
    frame[code] = (uint8_t)(at - code);
    frame[at++] = 0;
    return at;
}

int main(int argc, char **argv)
{
    if (argc != 5) {
        fprintf(stderr, "usage: %s DEVICE SNR_DB REMAINING|- AGE_MS\n", argv[0]);
        return 2;
    }
    float remaining = strtof(argv[3], NULL);
    uint8_t frame[FRAME_BYTES];
    size_t length = gleaner_report(frame, (uint32_t)strtoul(argv[1], NULL, 10), strtof(argv[2], NULL),
                                   strcmp(argv[3], "-") == 0 ? NULL : &remaining,
                                   (uint32_t)strtoul(argv[4], NULL, 10));
    return fwrite(frame, 1, length, stdout) == length ? 0 : 2;
}
