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

uint32_t gc_crc32(uint32_t crc, const uint8_t *data, size_t size) {
  crc = ~crc;
  for (size_t i = 0; i < size; i++) {
    crc ^= data[i];
    for (uint32_t bit = 0; bit < 8u; bit++) {
      crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
  }
  return ~crc;
}
