// A reduced model of a robot with the settings of its loop, read in place from a blob in flash.
//
// The blob is little-endian and starts with gc_model_header. The tables follow without gaps, in the order of gc_model;
// src/gravcomp/firmware/model_blob.py writes them. Nothing is copied: the pointers of gc_model point into the blob.
#ifndef GC_MODEL_H
#define GC_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "law_of_invariants.h"
#include "settings.h"

#define GC_MODEL_MAGIC 0x424d4347u // "GCMB"
#define GC_MODEL_VERSION 3u
#define GC_TILE 4u // rows of a tile and strains of a block: what one kernel holds in registers
#define GC_MODES_MAX 48u
#define GC_STRAINS_MAX 96u
#define GC_CABLES_MAX 9u
#define GC_PIECES_MAX 512u
#define GC_PAIRS_MAX (GC_MODES_MAX * (GC_MODES_MAX + 1u) / 2u)
#define GC_POINTS_MAX 64u
#define GC_LAW_POINTS_MAX 128u
#define GC_BRANCHES_MAX 4u
#define GC_ROBOT_BYTES 16u

// First bytes of a blob. crc: CRC-32 (IEEE 802.3) of all bytes after this field.
typedef struct {
  uint32_t magic;
  uint32_t version;
  uint32_t size; // bytes, header included
  uint32_t crc;
  uint8_t robot[GC_ROBOT_BYTES]; // digest of the robot's description
  uint32_t modes;                // r, a multiple of GC_TILE
  uint32_t strains;              // k, a multiple of GC_TILE, at least r
  uint32_t cables;               // m
  uint32_t pieces;               // s
  uint32_t settings;             // number of floats of gc_settings
  uint32_t points;               // n, of the backbone
  uint32_t law_points;           // at which a law of rubber is evaluated
  uint32_t branches;             // of the material's memory
} gc_model_header;

// Why a blob is refused.
typedef enum {
  GC_MODEL_OK = 0,
  GC_MODEL_CUT_OFF = 1,      // fewer bytes than the header or its size say
  GC_MODEL_FOREIGN = 2,      // not a blob of a model
  GC_MODEL_OTHER_VERSION = 3,
  GC_MODEL_TOO_BIG = 4,      // more modes, strains, cables, pieces, points or branches than this firmware has room for
  GC_MODEL_WRONG_SIZE = 5,   // the tables do not fill the size, or there are bytes after them
  GC_MODEL_WRONG_CRC = 6,
  GC_MODEL_OTHER_ROBOT = 7,
  GC_MODEL_NOT_FINITE = 8    // a setting or a table has a number that is not finite
} gc_model_status;

// A Maxwell branch: stiffness over the long-term one, and d and g of creep.h over a period.
typedef struct {
  float ratio, decay, gain;
} gc_branch;

// Tables of a model; r coordinates, k strains, m cables, s pieces; SI units.
//
// Symmetric matrices are stored by tiles: for every four rows 4 t to 4 t + 3 the columns j < 4 t, each with its four
// entries, then the ten entries of the lower triangle on the diagonal, row by row.
typedef struct {
  uint32_t modes, strains, cables, pieces, points, law_points, branches;
  const float *quadratic;         // [k / 4][r (r + 1) / 2][4] B of every block of four strains, by tiles
  const float *cable_stiffness;   // [r (r + 1) / 2][m] stiffness of each cable under unit tension, by tiles
  const float *piece_change;      // [s][3][r] D: change of the piece by the coordinates
  const float *weight;            // [3][r] force of unit gravity
  const float *section_change;    // [9][r] tip section p, f1, f2
  const float *section_rest;      // [9]
  const float *piece_rest;        // [s][3] m
  const float *point_change;      // [n][3][r] change of the backbone's points
  const float *point_rest;        // [n][3] m
  const float *rest_length;       // [m] m
  const float *axial_compliance;  // [m] m/N
  const float *friction;          // [m] coefficient
  const float *sheath_angle;      // [m] rad
  const float *free_length;       // [m] m
  const float *least_tension;     // [m] N
  const float *law_change;        // [law_points][r][9] G: change of H, row by row, by the coordinates
  const gc_law *law;              // [law_points]
  const gc_branch *branch;        // [branches]
  const gc_settings *settings;
  const uint8_t *piece_cable;     // [s]
  const uint8_t *robot;           // [16]
  bool slides;                    // a cable has friction
} gc_model;

// Called again and again while something takes long, so that a watchdog does not bite.
typedef void gc_alive(void);

// Check the blob of `size` bytes, 4-byte aligned, and set the model's pointers into it; the model is written only on success.
//
// magic: the first word, which may not be in the blob yet; robot: digest that the blob must have, NULL: any; alive: called at
// least every 16 KB of the check, NULL: nothing is.
gc_model_status gc_model_open(gc_model *model, const uint8_t *blob, size_t size, uint32_t magic, const uint8_t *robot,
                              gc_alive *alive);

// Return the first word of a blob of `size` bytes, 0 where there is none.
uint32_t gc_model_magic(const uint8_t *blob, size_t size);

// Return the number of bytes of the blob at the begin of a place of `room` bytes, as its header says; at most `room`.
size_t gc_model_length(const uint8_t *blob, size_t room);

#endif
