// The header by which the start recognises a whole image; `./gravcomp firmware build` fills it in after linking.
#ifndef GC_IMAGE_H
#define GC_IMAGE_H

#include <stdint.h>

#define GC_IMAGE_MAGIC 0x474D4947u  // "GIMG" in memory

typedef struct {
  uint32_t magic;
  uint32_t code_size;   // bytes from 0x08010000
  uint32_t code_check;  // CRC-32 of them
  uint32_t boot_size;   // bytes of the boot part behind this header
  uint32_t boot_check;  // CRC-32 of them
} gc_image_header;

extern const gc_image_header gc_image;

#endif
