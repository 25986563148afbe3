// Checks of frames and of stored data.
#ifndef GC_CRC_H
#define GC_CRC_H

#include <stddef.h>
#include <stdint.h>

// CRC-8/SAE-J1850 (polynomial 0x1D, start and final XOR 0xFF) of the low byte of `id` and `size` bytes.
uint8_t gc_crc8(uint16_t id, const uint8_t *data, size_t size);

// Continue a CRC-32 (IEEE 802.3, as zlib's crc32) from `crc`, 0 at the start.
uint32_t gc_crc32(uint32_t crc, const uint8_t *data, size_t size);

#endif
