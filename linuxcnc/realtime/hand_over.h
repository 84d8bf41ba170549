/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef ABBE_LINUXCNC_HAND_OVER_H
#define ABBE_LINUXCNC_HAND_OVER_H
/* Shared memory between the realtime component abbe_correction and abbe-linuxcnc-feeder. It belongs
   to the component, so a feeder that was killed leaves nothing behind in HAL, and the next one
   attaches to the same memory. Neither side locks: each writes a set of values between two sequence
   numbers, and the reader discards a set during which it was written. Plain C and C++, without HAL.
   Lengths in mm. */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define ABBE_HAND_OVER_KEY 0x41424245 /* System V shared memory */
#define ABBE_HAND_OVER_SIZE 4096
#define ABBE_HAND_OVER_VERSION 1u
#define ABBE_CORRECTED_JOINTS 3 /* X, Y, Z; further joints of the component are not corrected */
#define ABBE_REASON_SIZE 160

enum abbe_tool {
  ABBE_TOOL_KNOWN = 0,
  ABBE_TOOL_NOT_LINKED,    /* a pin of tool offset or number is not linked to a signal */
  ABBE_TOOL_OFFSET_MISSING /* another tool is in the spindle, its offset is not applied yet */
};

/* Written by the realtime component in every servo cycle. */
struct abbe_control {
  uint64_t cycle;
  double position[ABBE_CORRECTED_JOINTS]; /* joint.N.pos-cmd */
  double tool_offset[3];                  /* motion.tooloffset.x, y, z */
  int32_t tool_number;
  uint32_t tool; /* enum abbe_tool */
  uint32_t homed;
};

/* Written by the feeder in every cycle of its loop. */
struct abbe_wanted {
  double correction[ABBE_CORRECTED_JOINTS];
  uint32_t valid;
  char reason[ABBE_REASON_SIZE]; /* why not valid, with a terminating 0 */
};

struct abbe_sequence {
  uint32_t begin, end; /* different while the values are written */
};

struct abbe_hand_over {
  uint32_t version; /* ABBE_HAND_OVER_VERSION once the realtime component has initialized it */
  uint32_t closed;  /* 1: the realtime component has ended */
  int32_t feeder;   /* process id of the feeder that may write; 0: none */
  struct abbe_sequence control_sequence, wanted_sequence;
  struct abbe_control control;
  struct abbe_wanted wanted;
};

/* Writes a set of values. One writer for each sequence. A writer that was killed in between is
   continued by the next one: the number is that after `end`. */
static inline void abbe_write(struct abbe_sequence* sequence, void* to, const void* from,
                              unsigned long size) {
  const uint32_t number = __atomic_load_n(&sequence->end, __ATOMIC_RELAXED) + 1;
  __atomic_store_n(&sequence->begin, number, __ATOMIC_RELAXED);
  __atomic_thread_fence(__ATOMIC_RELEASE); /* pairs with the acquire fence in abbe_read() */
  memcpy(to, from, size);
  __atomic_store_n(&sequence->end, number,
                   __ATOMIC_RELEASE); /* pairs with the acquire load there */
}

/* Copies a set of values and its number. False, with `to` undefined, if it was being written. */
static inline bool abbe_read(const struct abbe_sequence* sequence, void* to, const void* from,
                             unsigned long size, uint32_t* number) {
  const uint32_t end = __atomic_load_n(&sequence->end, __ATOMIC_ACQUIRE);
  memcpy(to, from, size);
  __atomic_thread_fence(__ATOMIC_ACQUIRE);
  if (__atomic_load_n(&sequence->begin, __ATOMIC_RELAXED) != end) return false;
  *number = end;
  return true;
}

/* Whether the tool offset of the control is that of the tool in the spindle. Zero-initialized
   before the first cycle. */
struct abbe_tool_watch {
  bool seen;
  bool missing; /* the number has changed, the offset has not changed since */
  int32_t number;
  double offset[3];
};

/* One cycle. After a change of the number the offset is that of the tool before until the control
   changes it (G43). Numbers <= 0 mean that no tool is in the spindle. A tool that is in the spindle
   at the first cycle has no offset yet. */
static inline enum abbe_tool abbe_watch_tool(struct abbe_tool_watch* watch, bool linked,
                                             int32_t number, const double offset[3]) {
  const int32_t in_spindle = number > 0 ? number : 0;
  if (!linked) {
    watch->seen = false;
    return ABBE_TOOL_NOT_LINKED;
  }

  if (!watch->seen) {
    watch->seen = true;
    watch->missing = in_spindle != 0;
  } else {
    if (in_spindle != watch->number) watch->missing = true;
    if (memcmp(offset, watch->offset, sizeof watch->offset) != 0) watch->missing = false;
  }
  watch->number = in_spindle;
  memcpy(watch->offset, offset, sizeof watch->offset);
  return watch->missing ? ABBE_TOOL_OFFSET_MISSING : ABBE_TOOL_KNOWN;
}

#endif
