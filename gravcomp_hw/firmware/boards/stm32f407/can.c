#include "can.h"

#include "../../core/memory.h"
#include "clock.h"
#include "registers.h"

// A bit has 14 quanta of 14 MHz: 1 + 11 + 2, sampled at 86 %.
#define QUANTA_MHZ 14u
#define SEGMENT_1 11u
#define SEGMENT_2 2u
#define MAILBOXES 3u
#define FIRST_FILTER_OF_CAN2 14u

static gc_can_registers *controller(uint32_t bus) { return bus == 0u ? CAN1 : CAN2; }

static void start(gc_can_registers *can) {
  can->mcr = CAN_MCR_INRQ;  // leaves sleep
  while ((can->msr & CAN_MSR_INAK) == 0u) {
  }
  can->mcr = CAN_MCR_INRQ | CAN_MCR_ABOM | CAN_MCR_TXFP;
  can->btr = (SEGMENT_2 - 1u) << 20 | (SEGMENT_1 - 1u) << 16 | (GC_APB1_MHZ / QUANTA_MHZ - 1u);
  can->ier = CAN_IER_FMPIE0 | CAN_IER_TMEIE;
}

void gc_can_start(void) {
  RCC->apb1enr |= RCC_APB1_CAN1 | RCC_APB1_CAN2;
  start(CAN1);
  start(CAN2);
  // Filters 0 and 14, one for each controller, let everything through to FIFO 0.
  CAN1->fmr = FIRST_FILTER_OF_CAN2 << 8 | 1u;
  const uint32_t both = 1u | 1u << FIRST_FILTER_OF_CAN2;
  CAN1->fs1r = both;
  for (uint32_t half = 0; half < 2u; half++) {
    CAN1->filters[half] = 0u;
    CAN1->filters[2u * FIRST_FILTER_OF_CAN2 + half] = 0u;
  }
  CAN1->fa1r = both;
  CAN1->fmr = FIRST_FILTER_OF_CAN2 << 8;
  // Leaving initialisation waits for 11 recessive bits, which may never come: nobody waits here.
  CAN1->mcr &= ~CAN_MCR_INRQ;
  CAN2->mcr &= ~CAN_MCR_INRQ;
}

void gc_can_receive(uint32_t bus, gc_ring *ring) {
  gc_can_registers *can = controller(bus);
  while ((can->rf0r & CAN_RFR_PENDING) != 0u) {
    const gc_mailbox *box = &can->rx[0];
    const uint32_t identifier = box->ir;
    const uint32_t low = box->dlr;
    const uint32_t high = box->dhr;
    gc_frame frame;
    gc_zero(&frame, sizeof frame);
    frame.id = (uint16_t)(identifier >> CAN_IR_ID_SHIFT);
    frame.length = (uint8_t)(box->dtr & 15u);
    frame.extended = (uint8_t)((identifier & (CAN_IR_IDE | CAN_IR_RTR)) != 0u ? 1u : 0u);
    gc_copy(&frame.data[0], &low, sizeof low);
    gc_copy(&frame.data[4], &high, sizeof high);
    can->rf0r = CAN_RFR_RELEASE;
    const uint32_t next = (ring->head + 1u) % GC_RING_LENGTH;
    if (next == ring->tail) {
      ring->lost++;
    } else {
      ring->frames[ring->head] = frame;
      ring->head = next;
    }
  }
}

bool gc_ring_take(gc_ring *ring, gc_frame *frame) {
  if (ring->tail == ring->head) {
    return false;
  }
  *frame = ring->frames[ring->tail];
  ring->tail = (ring->tail + 1u) % GC_RING_LENGTH;
  return true;
}

void gc_can_send(gc_board *board, uint32_t bus) {
  gc_can_registers *can = controller(bus);
  can->tsr = CAN_TSR_REQUESTS_DONE;
  for (uint32_t index = 0; index < MAILBOXES; index++) {
    gc_frame frame;
    if ((can->tsr >> (CAN_TSR_EMPTY_SHIFT + index) & 1u) == 0u) {
      continue;
    }
    if (!gc_board_transmit(board, bus, &frame)) {
      return;
    }
    uint32_t low;
    uint32_t high;
    gc_copy(&low, &frame.data[0], sizeof low);
    gc_copy(&high, &frame.data[4], sizeof high);
    gc_mailbox *box = &can->tx[index];
    box->dtr = frame.length;
    box->dlr = low;
    box->dhr = high;
    box->ir = (uint32_t)frame.id << CAN_IR_ID_SHIFT | CAN_IR_TXRQ;
  }
}

bool gc_can_is_off(uint32_t bus) { return (controller(bus)->esr & CAN_ESR_BOFF) != 0u; }
