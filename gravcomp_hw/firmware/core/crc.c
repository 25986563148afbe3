#include "crc.h"

static uint8_t crc8_step(uint8_t crc) {
  for (uint32_t bit = 0; bit < 8u; bit++) {
    crc = (uint8_t)((crc & 0x80u) != 0u ? (uint8_t)(crc << 1) ^ 0x1Du : (uint8_t)(crc << 1));
  }
  return crc;
}

uint8_t gc_crc8(uint16_t id, const uint8_t *data, size_t size) {
  uint8_t crc = crc8_step((uint8_t)(0xFFu ^ (id & 0xFFu)));
  for (size_t i = 0; i < size; i++) {
    crc = crc8_step(crc ^ data[i]);
  }
  return crc ^ 0xFFu;
}

// The remainders of the sixteen half bytes.
static const uint32_t REMAINDERS[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
                                        0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                        0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};

uint32_t gc_crc32(uint32_t crc, const uint8_t *data, size_t size) {
  crc = ~crc;
  for (size_t i = 0; i < size; i++) {
    crc ^= data[i];
    crc = (crc >> 4) ^ REMAINDERS[crc & 15u];
    crc = (crc >> 4) ^ REMAINDERS[crc & 15u];
  }
  return ~crc;
}
