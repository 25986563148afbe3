// A fuzzer for compilers without libFuzzer: it changes inputs of the corpus at random and keeps those that reach new code.
//
//   fuzz FRAMES SEED OUT FILE...    at least so many frames; new inputs are written into OUT unless it is "-"
//
// GCC's -fsanitize-coverage=trace-pc calls __sanitizer_cov_trace_pc at each branch of the firmware; this file is compiled without.
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fuzz_target.h"

#define LONGEST 4096u
#define MOST 4096u
#define PLACES 65536u

void __sanitizer_cov_trace_pc(void);

typedef struct {
  uint8_t *bytes;
  size_t size;
} input;

static uint8_t reached[PLACES];
static size_t edges;
static uintptr_t last;
static int grown;
static input corpus[MOST];
static size_t kept;
static uint64_t chance;

void __sanitizer_cov_trace_pc(void) {
  const uintptr_t here = (uintptr_t)__builtin_return_address(0);
  const uintptr_t mixed = (here ^ last >> 1) * (uintptr_t)0x9E3779B97F4A7C15u;
  const size_t place = (size_t)(mixed >> 48) % PLACES;
  last = here;
  if (reached[place] == 0u) {
    reached[place] = 1u;
    edges++;
    grown = 1;
  }
}

static uint32_t draw(uint32_t below) {
  chance ^= chance << 13;
  chance ^= chance >> 7;
  chance ^= chance << 17;
  return (uint32_t)(chance >> 11) % below;
}

static void keep(const uint8_t *bytes, size_t size) {
  if (kept >= MOST) {
    return;
  }
  corpus[kept].bytes = (uint8_t *)malloc(size + 1u);
  if (corpus[kept].bytes == NULL) {
    exit(2);
  }
  memcpy(corpus[kept].bytes, bytes, size);
  corpus[kept].size = size;
  kept++;
}

static size_t changed(uint8_t *bytes) {
  static const uint16_t ids[] = {0x1FF, 0x200, 0x201, 0x203, 0x206, 0x310, 0x315, 0x320, 0x322, 0x328, 0x329, 0x32A, 0x32F};
  const input *base = &corpus[draw((uint32_t)kept)];
  size_t size = base->size;
  memcpy(bytes, base->bytes, size);
  const uint32_t steps = 1u + draw(6u);
  for (uint32_t k = 0; k < steps; k++) {
    const uint32_t kind = draw(5u);
    const size_t at = size > 0u ? draw((uint32_t)size) : 0u;
    if (kind == 0u && size > 0u) {
      bytes[at] = (uint8_t)draw(256u);
    } else if (kind == 1u && size > 0u) {
      bytes[at] ^= (uint8_t)(1u << draw(8u));
    } else if (kind == 2u && size + 12u <= LONGEST) {  // a frame
      const uint16_t id = draw(8u) == 0u ? (uint16_t)draw(2048u) : ids[draw(sizeof ids / sizeof ids[0])];
      const uint8_t length = (uint8_t)(draw(6u) == 0u ? draw(16u) : (id == 0x320u ? 4u : 8u));
      bytes[size++] = (uint8_t)(6u | (draw(4u) > 0u ? 8u : 0u) | (draw(3u) == 0u ? 16u : 0u));
      bytes[size++] = (uint8_t)(id >> 8);
      bytes[size++] = (uint8_t)id;
      bytes[size++] = length;
      for (uint32_t i = 0; i < 8u; i++) {
        bytes[size++] = (uint8_t)(draw(3u) == 0u ? draw(8u) : draw(256u));
      }
      if (id == 0x322u && draw(2u) == 0u) {
        bytes[size - 8u] = 0xFFu;
        bytes[size - 7u] = (uint8_t)(1u + draw(7u));
      }
    } else if (kind == 3u && size + 1u <= LONGEST) {  // time passes
      bytes[size++] = (uint8_t)(draw(32u) << 3 | draw(2u));
    } else if (kind == 4u && kept > 1u) {  // the end of another input
      const input *other = &corpus[draw((uint32_t)kept)];
      const size_t from = other->size > 0u ? draw((uint32_t)other->size) : 0u;
      const size_t more = other->size - from;
      if (size + more <= LONGEST) {
        memcpy(&bytes[size], &other->bytes[from], more);
        size += more;
      }
    } else {
      // This step changes nothing.
    }
  }
  return size;
}

static void load(const char *path) {
  static uint8_t bytes[LONGEST];
  FILE *file = fopen(path, "rb");
  if (file == NULL) {
    (void)fprintf(stderr, "%s cannot be read\n", path);
    exit(2);
  }
  const size_t size = fread(bytes, 1u, LONGEST, file);
  (void)fclose(file);
  (void)LLVMFuzzerTestOneInput(bytes, size);
  keep(bytes, size);
}

static void store(const char *folder, const uint8_t *bytes, size_t size) {
  char path[512];
  (void)snprintf(path, sizeof path, "%s/%04zu.bin", folder, kept);
  FILE *file = fopen(path, "wb");
  if (file == NULL || fwrite(bytes, 1u, size, file) != size) {
    (void)fprintf(stderr, "%s cannot be written\n", path);
    exit(2);
  }
  (void)fclose(file);
}

int main(int count, char **words) {
  static uint8_t bytes[LONGEST];
  if (count < 4) {
    (void)fprintf(stderr, "fuzz FRAMES SEED OUT FILE...\n");
    return 2;
  }
  const uint64_t wanted = strtoull(words[1], NULL, 10);
  chance = strtoull(words[2], NULL, 10) * 2u + 0x9E3779B97F4A7C15u;
  for (int k = 4; k < count; k++) {
    load(words[k]);
  }
  if (kept == 0u) {
    keep((const uint8_t *)"\1", 1u);
  }
  const size_t given = kept;
  while (gc_counted.frames < wanted) {
    const size_t size = changed(bytes);
    grown = 0;
    last = 0u;
    (void)LLVMFuzzerTestOneInput(bytes, size);
    if (grown != 0) {
      keep(bytes, size);
      if (strcmp(words[3], "-") != 0) {
        store(words[3], bytes, size);
      }
    }
  }
  (void)printf("{\"frames\": %llu, \"samples\": %llu, \"answers\": %llu, \"violations\": %llu, \"edges\": %zu, \"found\": %zu}\n",
         (unsigned long long)gc_counted.frames, (unsigned long long)gc_counted.samples,
         (unsigned long long)gc_counted.answers, (unsigned long long)gc_counted.violations, edges, kept - given);
  return 0;
}
