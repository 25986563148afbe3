#include "model.h"

#include "../core/crc.h"
#include "../core/maths.h"

#define GC_SETTINGS_FLOATS ((uint32_t)(sizeof(gc_settings) / sizeof(float)))
#define GC_SECTION_ROWS 9u

#define GC_LAW_FLOATS ((uint32_t)(sizeof(gc_law) / sizeof(float)))
#define GC_BRANCH_FLOATS ((uint32_t)(sizeof(gc_branch) / sizeof(float)))

// Number of floats of all tables, without the numbers of the pieces' cables.
static size_t float_count(const gc_model_header *h) {
  const size_t r = h->modes, s = h->pieces, pairs = r * (r + 1u) / 2u;
  return pairs * (h->strains + h->cables) + s * 3u * r + (3u + GC_SECTION_ROWS) * r + GC_SECTION_ROWS + s * 3u +
         (size_t)h->points * 3u * (r + 1u) + (size_t)h->cables * 6u + (size_t)h->law_points * (9u * r + GC_LAW_FLOATS) +
         (size_t)h->branches * GC_BRANCH_FLOATS + GC_SETTINGS_FLOATS;
}

// Number of bytes of a blob with the counts of a header, all of them within the maxima.
static size_t byte_count(const gc_model_header *header) {
  const size_t numbers = ((size_t)header->pieces + 3u) / 4u * 4u;
  return sizeof(gc_model_header) + sizeof(float) * float_count(header) + numbers;
}

#define GC_PART 16384u  // bytes of a check until it says that it goes on

static void say_alive(gc_alive *alive) {
  if (alive != NULL) {
    alive();
  }
}

static bool all_finite(const float *values, size_t count, gc_alive *alive) {
  for (size_t i = 0; i < count; ++i) {
    if (i % (GC_PART / sizeof(float)) == 0u) {
      say_alive(alive);
    }
    if (!gc_finite(values[i])) {
      return false;
    }
  }
  return true;
}

static uint32_t crc_of(const uint8_t *data, size_t size, gc_alive *alive) {
  uint32_t crc = 0u;
  while (size > 0u) {
    const size_t part = size < GC_PART ? size : GC_PART;
    crc = gc_crc32(crc, data, part);
    data += part;
    size -= part;
    say_alive(alive);
  }
  return crc;
}

static bool fits(const gc_model_header *h) {
  return h->modes >= GC_TILE && h->modes <= GC_MODES_MAX && h->modes % GC_TILE == 0u && h->strains >= h->modes &&
         h->strains <= GC_STRAINS_MAX && h->strains % GC_TILE == 0u && h->cables >= 1u && h->cables <= GC_CABLES_MAX &&
         h->pieces >= 1u && h->pieces <= GC_PIECES_MAX && h->points <= GC_POINTS_MAX &&
         h->law_points <= GC_LAW_POINTS_MAX && h->branches <= GC_BRANCHES_MAX;
}

uint32_t gc_model_magic(const uint8_t *blob, size_t size) {
  return size < sizeof(gc_model_header) ? 0u : ((const gc_model_header *)(const void *)blob)->magic;
}

size_t gc_model_length(const uint8_t *blob, size_t room) {
  const size_t size = room < sizeof(gc_model_header) ? room : ((const gc_model_header *)(const void *)blob)->size;
  return size < room ? size : room;
}

gc_model_status gc_model_open(gc_model *model, const uint8_t *blob, size_t size, uint32_t magic, const uint8_t *robot,
                              gc_alive *alive) {
  if (size < sizeof(gc_model_header)) {
    return GC_MODEL_CUT_OFF;
  }
  const gc_model_header *header = (const gc_model_header *)(const void *)blob;
  if (magic != GC_MODEL_MAGIC) {
    return GC_MODEL_FOREIGN;
  }
  if (header->version != GC_MODEL_VERSION || header->settings != GC_SETTINGS_FLOATS) {
    return GC_MODEL_OTHER_VERSION;
  }
  if (!fits(header)) {
    return GC_MODEL_TOO_BIG;
  }
  if (size < header->size) {
    return GC_MODEL_CUT_OFF;
  }
  if (size > header->size || header->size != byte_count(header)) {
    return GC_MODEL_WRONG_SIZE;
  }
  const size_t before = offsetof(gc_model_header, robot);
  if (crc_of(blob + before, header->size - before, alive) != header->crc) {
    return GC_MODEL_WRONG_CRC;
  }
  for (uint32_t i = 0; robot != NULL && i < GC_ROBOT_BYTES; ++i) {
    if (robot[i] != header->robot[i]) {
      return GC_MODEL_OTHER_ROBOT;
    }
  }
  const uint32_t r = header->modes, k = header->strains, m = header->cables, s = header->pieces;
  const uint32_t n = header->points;
  const float *next = (const float *)(const void *)(blob + sizeof(gc_model_header));
  const size_t count = float_count(header);
  if (!all_finite(next, count, alive)) {
    return GC_MODEL_NOT_FINITE;
  }
  const uint8_t *numbers = (const uint8_t *)(next + count);
  for (uint32_t i = 0; i < s; ++i) {
    if (numbers[i] >= m || (i > 0u && numbers[i] < numbers[i - 1u])) {
      return GC_MODEL_WRONG_SIZE;
    }
  }
  gc_model opened;
  opened.modes = r, opened.strains = k, opened.cables = m, opened.pieces = s, opened.points = n;
  opened.law_points = header->law_points, opened.branches = header->branches;
  opened.quadratic = next, next += (size_t)r * (r + 1u) / 2u * k;
  opened.cable_stiffness = next, next += (size_t)r * (r + 1u) / 2u * m;
  opened.piece_change = next, next += (size_t)s * 3u * r;
  opened.weight = next, next += 3u * r;
  opened.section_change = next, next += GC_SECTION_ROWS * r;
  opened.section_rest = next, next += GC_SECTION_ROWS;
  opened.piece_rest = next, next += (size_t)s * 3u;
  opened.point_change = next, next += (size_t)n * 3u * r;
  opened.point_rest = next, next += (size_t)n * 3u;
  opened.rest_length = next, next += m;
  opened.axial_compliance = next, next += m;
  opened.friction = next, next += m;
  opened.sheath_angle = next, next += m;
  opened.free_length = next, next += m;
  opened.least_tension = next, next += m;
  opened.law_change = next, next += (size_t)opened.law_points * 9u * r;
  opened.law = (const gc_law *)(const void *)next, next += (size_t)opened.law_points * GC_LAW_FLOATS;
  opened.branch = (const gc_branch *)(const void *)next, next += (size_t)opened.branches * GC_BRANCH_FLOATS;
  opened.settings = (const gc_settings *)(const void *)next;
  opened.piece_cable = numbers;
  opened.robot = header->robot;
  opened.slides = false;
  for (uint32_t i = 0; i < m; ++i) {
    opened.slides = opened.slides || opened.friction[i] != 0.0f;
  }
  *model = opened;
  return GC_MODEL_OK;
}
