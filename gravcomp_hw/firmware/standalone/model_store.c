#include "model_store.h"

#include "../core/memory.h"

bool gc_model_store_start(gc_model_store *store) {
  store->used = GC_MODEL_SLOTS;
  for (uint32_t slot = 0; slot < GC_MODEL_SLOTS && store->used == GC_MODEL_SLOTS; ++slot) {
    const uint8_t *blob = store->memory.slots[slot];
    const uint32_t magic = gc_model_magic(blob, GC_MODEL_SLOT);
    if (gc_standalone_take(store->loop, blob, gc_model_length(blob, GC_MODEL_SLOT), magic, store->memory.alive)) {
      store->used = slot;
    }
  }
  return store->used < GC_MODEL_SLOTS;
}

bool gc_model_store_receive(void *context, const gc_frame *frame, gc_frame *reply) {
  gc_model_store *store = (gc_model_store *)context;
  const bool request = frame->id == GC_ID_MODEL_REQUEST && gc_frame_is_whole(frame, 8u);
  if (!request && !(frame->id == GC_ID_MODEL_DATA && frame->length == 8u)) {
    return gc_standalone_receive(store->loop, frame, reply);
  }
  const uint32_t next = (store->head + 1u) % GC_STORE_FRAMES;
  if (next != store->tail) {  // else the frame is lost, which the next one shows
    store->frames[store->head] = *frame;
    store->head = next;
  }
  return false;
}

bool gc_model_store_waits(const gc_model_store *store) { return store->head != store->tail; }

static uint32_t sectors_of(uint32_t size) { return (size + GC_MODEL_SECTOR - 1u) / GC_MODEL_SECTOR; }

static uint8_t begin(gc_model_store *store, uint32_t size) {
  store->begun = false;
  if (size < sizeof(gc_model_header) || size > GC_MODEL_SLOT) {
    return GC_STORE_TOO_BIG;
  }
  store->slot = store->used == 0u ? 1u : 0u;
  store->size = size;
  store->taken = store->erased = store->magic = 0u;
  store->said_lost = false;
  store->begun = true;
  return GC_STORE_DONE;
}

static uint8_t erase(gc_model_store *store, uint32_t sector) {
  if (!store->begun || sector != store->erased || sector >= sectors_of(store->size)) {
    return GC_STORE_NOT_BEGUN;
  }
  if (!store->memory.erase(store->memory.context, store->slot, sector)) {
    store->begun = false;
    return GC_STORE_NOT_STORED;
  }
  ++store->erased;
  return GC_STORE_DONE;
}

// Take the bytes of a frame of data. Returns false where the flash does not.
static bool store_bytes(gc_model_store *store, const uint8_t *bytes) {
  for (uint32_t i = 0; i < GC_MODEL_BYTES && store->taken < store->size; ++i) {
    store->pending[store->taken % 4u] = bytes[i];
    ++store->taken;
    if (store->taken % 4u != 0u && store->taken < store->size) {
      continue;
    }
    const uint32_t offset = (store->taken - 1u) / 4u * 4u;
    uint32_t word = 0xFFFFFFFFu;
    gc_copy(&word, store->pending, store->taken - offset);
    if (offset == 0u) {
      store->magic = word;
    } else if (!store->memory.write(store->memory.context, store->slot, offset, word)) {
      return false;
    }
  }
  return true;
}

static uint32_t sequence_of(const gc_model_store *store) { return store->taken / GC_MODEL_BYTES % 256u; }

// Take a frame of data; returns whether it is answered, with the result.
static bool data(gc_model_store *store, const gc_frame *frame, uint8_t *result) {
  *result = GC_STORE_DONE;
  if (!store->begun || store->erased < sectors_of(store->size)) {
    *result = GC_STORE_NOT_BEGUN;
    return true;
  }
  if (store->taken >= store->size || frame->data[0] != sequence_of(store)) {
    *result = GC_STORE_LOST;
    const bool said = store->said_lost;
    store->said_lost = true;
    return !said;
  }
  store->said_lost = false;
  if (!store_bytes(store, &frame->data[1])) {
    store->begun = false;
    *result = GC_STORE_NOT_STORED;
    return true;
  }
  return sequence_of(store) % GC_MODEL_WINDOW == 0u || store->taken >= store->size;
}

// Make the first word of a place zero: it has no model any more.
static bool unmark(gc_model_store *store, uint32_t slot) { return store->memory.write(store->memory.context, slot, 0u, 0u); }

static uint8_t end(gc_model_store *store) {
  if (!store->begun || store->taken < store->size) {
    return GC_STORE_NOT_BEGUN;
  }
  store->begun = false;
  const uint8_t *blob = store->memory.slots[store->slot];
  gc_model model;
  const uint8_t *robot = store->loop->loaded ? store->loop->model.robot : NULL;
  store->loop->refusal = gc_model_open(&model, blob, store->size, store->magic, robot, store->memory.alive);
  if (store->loop->refusal != GC_MODEL_OK) {
    return GC_STORE_REFUSED;
  }
  if (!store->memory.write(store->memory.context, store->slot, 0u, store->magic)) {
    return GC_STORE_NOT_STORED;  // the loop goes on with the old one, also after a reset
  }
  gc_standalone_use(store->loop, &model);
  // Until the next write both places have a whole model of this robot.
  const uint32_t before = store->used;
  store->used = store->slot;
  const bool unmarked = before == GC_MODEL_SLOTS || unmark(store, before);
  return unmarked ? GC_STORE_DONE : GC_STORE_NOT_STORED;
}

static uint8_t forget(gc_model_store *store, uint32_t word) {
  if (word != GC_FORGET_WORD) {
    return GC_STORE_UNKNOWN;
  }
  const bool first = unmark(store, 0u), second = unmark(store, 1u);
  gc_zero(store->loop, sizeof *store->loop);
  store->used = GC_MODEL_SLOTS;
  store->begun = false;
  return first && second ? GC_STORE_DONE : GC_STORE_NOT_STORED;
}

static uint8_t perform(gc_model_store *store, const gc_frame *frame, bool may_write) {
  const uint8_t operation = frame->data[0];
  const uint32_t size = gc_get32(&frame->data[2]);
  if (operation == GC_MODEL_WHERE) {
    store->said_lost = false;
    return store->begun ? GC_STORE_DONE : GC_STORE_NOT_BEGUN;
  }
  if (operation < GC_MODEL_BEGIN || operation > GC_MODEL_FORGET) {
    return GC_STORE_UNKNOWN;
  }
  if (!may_write) {
    return GC_STORE_WRONG_STATE;
  }
  switch (operation) {
    case GC_MODEL_BEGIN:
      return begin(store, size);
    case GC_MODEL_ERASE:
      return erase(store, frame->data[1]);
    case GC_MODEL_END:
      return end(store);
    default:
      return forget(store, size);
  }
}

bool gc_model_store_work(gc_model_store *store, bool may_write, gc_frame *reply) {
  const gc_frame frame = store->frames[store->tail];
  store->tail = (store->tail + 1u) % GC_STORE_FRAMES;
  uint8_t result = GC_STORE_WRONG_STATE;
  bool answered = true;
  const bool is_request = frame.id == GC_ID_MODEL_REQUEST;
  if (is_request) {
    result = perform(store, &frame, may_write);
  } else if (may_write) {
    answered = data(store, &frame, &result);
  } else {
    answered = store->begun;
    store->begun = false;  // the board drives: the host begins again
  }
  if (!answered) {
    return false;
  }
  *reply = gc_frame_of(GC_ID_MODEL_REPLY, 8u);
  reply->data[0] = is_request ? frame.data[0] : (uint8_t)GC_MODEL_DATA;
  reply->data[1] = result;
  reply->data[2] = (uint8_t)store->loop->refusal;
  gc_put32(&reply->data[3], store->taken);
  gc_frame_seal(reply);
  return true;
}
