#ifndef ABBE_SUBSCRIBER_PUBLISHER_PIN_H
#define ABBE_SUBSCRIBER_PUBLISHER_PIN_H
/* The rule of publisher_pin.hpp in C (C99): which participant a subscriber uses when several DDS
   participants publish data under the same machine name. Its comment explains the rule and what it
   does not protect against. A test compares the verdicts of both.

   Uses the C library only; calls neither DDS nor a clock. For one thread. Create one
   `struct abbe_publisher_pin` for each machine name, and pass every received sample of this name:
   Identity to abbe_pin_identified(), all others to abbe_pin_heard(). Times are of CLOCK_MONOTONIC,
   in ns. `id` is the GUID prefix of the participant: the first 12 bytes of the GUID that all of its
   writers share [DDSI-RTPS 2.5, 8.2.4.2]. */

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum {
  ABBE_PIN_ID_BYTES = 12,
  ABBE_PIN_MACHINE_ID_BYTES = 37, /* string<36> of the IDL */
  ABBE_PIN_MOST_OTHERS = 7,       /* participants that are remembered beside the pinned one */
  ABBE_PIN_PLACES = ABBE_PIN_MOST_OTHERS + 1
};

/* Another participant can be pinned once the pinned one has sent nothing for this time. A subscriber
   that reads only topics that are repeated every second needs the second one. */
static const int64_t abbe_pin_silence_ns = INT64_C(300000000);
static const int64_t abbe_pin_silence_of_slow_topics_ns = INT64_C(1500000000);

/* The other publisher that a machine has seen, from the members twin and twin_seen of Identity. */
enum abbe_pin_twin { ABBE_PIN_TWIN_NONE, ABBE_PIN_TWIN_OTHER, ABBE_PIN_TWIN_SAME_ID };

/* Only samples with the first two are used. Report the participant for all after ABBE_PIN_WAITING. */
enum abbe_pin_verdict {
  ABBE_PIN_PINNED,       /* use the sample */
  ABBE_PIN_NEWLY_PINNED, /* use it and earlier ones of this participant; discard those of others */
  ABBE_PIN_WAITING,      /* keep the sample, do not use it */
  ABBE_PIN_FOREIGN, /* keep it: the participant sent beside the pinned one, will not be pinned */
  ABBE_PIN_OTHER_MACHINE, /* it publishes for another machine */
  ABBE_PIN_AMBIGUOUS,     /* two machines have this name, and no machine_id was given */
  ABBE_PIN_COPIED,        /* two publishers have this machine_id, or the name and no machine_id */
  ABBE_PIN_UNIDENTIFIED   /* it states an empty machine_id */
};

/* A participant that has sent samples of the machine. */
struct abbe_pin_place {
  bool used;
  uint8_t id[ABBE_PIN_ID_BYTES];
  int64_t first_ns, last_ns; /* its samples */
  int64_t alone_ns;          /* time of sending since the last sample of the pinned participant */
  bool foreign;
  bool identified; /* the next two are valid */
  char machine_id[ABBE_PIN_MACHINE_ID_BYTES];
  enum abbe_pin_twin twin;
};

struct abbe_publisher_pin {
  int64_t silence_ns;
  int pinned;          /* place of the pinned participant; -1: none */
  bool has_machine_id; /* `machine_id` was given, or is that of the first pinned participant */
  char machine_id[ABBE_PIN_MACHINE_ID_BYTES];
  struct abbe_pin_place places[ABBE_PIN_PLACES];
};

/* `machine_id`: of the machine that the subscriber is for; NULL or empty: the first one is pinned.
   Returns false if it is longer than the identity of a machine; then none is pinned. */
static inline bool abbe_pin_init(struct abbe_publisher_pin* pin, const char* machine_id,
                                 int64_t silence_ns) {
  memset(pin, 0, sizeof *pin);
  pin->silence_ns = silence_ns;
  pin->pinned = -1;
  pin->has_machine_id = machine_id != NULL && machine_id[0] != '\0';
  if (!pin->has_machine_id) return true;
  if (strlen(machine_id) >= sizeof pin->machine_id) return false;
  strcpy(pin->machine_id, machine_id);
  return true;
}

/* The members twin and twin_seen of an Identity of `machine`. */
static inline enum abbe_pin_twin abbe_pin_twin_of(bool twin, const char* twin_seen,
                                                  const char* machine) {
  static const char same[] = "the same machine_id, as machine ";
  const size_t begin = sizeof same - 1, length = strlen(machine);
  if (!twin) return ABBE_PIN_TWIN_NONE;
  return strncmp(twin_seen, same, begin) == 0 && strncmp(twin_seen + begin, machine, length) == 0 &&
                 twin_seen[begin + length] == ','
             ? ABBE_PIN_TWIN_SAME_ID
             : ABBE_PIN_TWIN_OTHER;
}

/* The place of a participant; -1: it is not remembered, and its samples need not be kept. A place
   whose first_ns has changed has another participant, or begins again. */
static inline int abbe_pin_place_of(const struct abbe_publisher_pin* pin, const uint8_t* id) {
  for (int i = 0; i < ABBE_PIN_PLACES; ++i)
    if (pin->places[i].used && memcmp(pin->places[i].id, id, ABBE_PIN_ID_BYTES) == 0) return i;
  return -1;
}

/* The rest up to abbe_pin_heard() is internal. */
static inline bool abbe_pin_is_other(const struct abbe_publisher_pin* pin, int place) {
  return place != pin->pinned && pin->places[place].used;
}

/* Takes the place of the participant whose last sample is oldest if ABBE_PIN_MOST_OTHERS are
   remembered. */
static inline int abbe_pin_add(struct abbe_publisher_pin* pin, const uint8_t* id, int64_t now_ns) {
  int others = 0, oldest = -1, place = -1;
  for (int i = 0; i < ABBE_PIN_PLACES; ++i) {
    if (!abbe_pin_is_other(pin, i)) {
      if (i != pin->pinned) place = i;
      continue;
    }
    ++others;
    if (oldest < 0 || pin->places[i].last_ns < pin->places[oldest].last_ns) oldest = i;
  }
  if (others == ABBE_PIN_MOST_OTHERS) {
    pin->places[oldest].used = false;
    place = oldest;
  }
  memset(&pin->places[place], 0, sizeof pin->places[place]);
  pin->places[place].used = true;
  memcpy(pin->places[place].id, id, ABBE_PIN_ID_BYTES);
  pin->places[place].first_ns = pin->places[place].last_ns = now_ns;
  return place;
}

/* A participant that has stated its identity, or sent a sample, within 1.5 s is there. */
static inline bool abbe_pin_is_present(const struct abbe_pin_place* p, int64_t now_ns) {
  return now_ns - p->last_ns < INT64_C(1500000000);
}

/* True if a foreign participant that is there states this identity: it is then the copy that the
   restarted publisher has seen. */
static inline bool abbe_pin_is_of_foreign(const struct abbe_publisher_pin* pin,
                                          const char* machine_id, int64_t now_ns) {
  for (int i = 0; i < ABBE_PIN_PLACES; ++i) {
    const struct abbe_pin_place* o = &pin->places[i];
    if (abbe_pin_is_other(pin, i) && o->foreign && o->identified &&
        strcmp(o->machine_id, machine_id) == 0 && abbe_pin_is_present(o, now_ns))
      return true;
  }
  return false;
}

/* True if another participant that is neither pinned nor foreign states the same identity, or like
   this one none. */
static inline bool abbe_pin_has_copy(const struct abbe_publisher_pin* pin, int place,
                                     int64_t now_ns) {
  const struct abbe_pin_place* p = &pin->places[place];
  for (int i = 0; i < ABBE_PIN_PLACES; ++i) {
    const struct abbe_pin_place* o = &pin->places[i];
    if (i != place && abbe_pin_is_other(pin, i) && !o->foreign && abbe_pin_is_present(o, now_ns) &&
        o->identified == p->identified && strcmp(o->machine_id, p->machine_id) == 0)
      return true;
  }
  return false;
}

/* An abbe-dds of an earlier version has no Identity: it is used by its name alone after 5 s, if no
   machine_id was given or pinned and no other participant states one. */
static inline bool abbe_pin_is_without_identity(const struct abbe_publisher_pin* pin,
                                                const struct abbe_pin_place* p, int64_t now_ns) {
  if (pin->has_machine_id || now_ns - p->first_ns < INT64_C(5000000000)) return false;
  for (int i = 0; i < ABBE_PIN_PLACES; ++i)
    if (abbe_pin_is_other(pin, i) && pin->places[i].identified) return false;
  return true;
}

/* Why a participant must not be pinned now, whether or not the pinned one is silent;
   ABBE_PIN_PINNED: no objection. */
static inline enum abbe_pin_verdict abbe_pin_objection(const struct abbe_publisher_pin* pin,
                                                       int place, int64_t now_ns) {
  const struct abbe_pin_place* p = &pin->places[place];
  if (!p->identified) {
    if (!abbe_pin_is_without_identity(pin, p, now_ns)) return ABBE_PIN_WAITING;
  } else {
    if (p->machine_id[0] == '\0') return ABBE_PIN_UNIDENTIFIED;
    if (pin->has_machine_id && strcmp(p->machine_id, pin->machine_id) != 0)
      return ABBE_PIN_OTHER_MACHINE;
    if (p->twin == ABBE_PIN_TWIN_SAME_ID && !abbe_pin_is_of_foreign(pin, p->machine_id, now_ns))
      return ABBE_PIN_COPIED;
    if (!pin->has_machine_id && p->twin == ABBE_PIN_TWIN_OTHER) return ABBE_PIN_AMBIGUOUS;
  }
  if (p->foreign) return ABBE_PIN_FOREIGN;
  return abbe_pin_has_copy(pin, place, now_ns) ? ABBE_PIN_COPIED : ABBE_PIN_PINNED;
}

/* Call it for every received sample of the machine, but those of the topic Identity. */
static inline enum abbe_pin_verdict abbe_pin_heard(struct abbe_publisher_pin* pin,
                                                   const uint8_t* id, int64_t now_ns) {
  /* A sample of the pinned participant 100 ms after the first one of another: the other is foreign.
     Of a pause between two samples of another at most 10 ms count. */
  const int64_t overlap_ns = INT64_C(100000000), longest_pause_ns = INT64_C(10000000),
                alone_ns = INT64_C(30000000);
  int place = abbe_pin_place_of(pin, id);
  if (place < 0) place = abbe_pin_add(pin, id, now_ns);
  struct abbe_pin_place* p = &pin->places[place];
  const int64_t pause_ns = now_ns - p->last_ns;
  p->last_ns = now_ns;

  if (place == pin->pinned) {
    for (int i = 0; i < ABBE_PIN_PLACES; ++i) {
      struct abbe_pin_place* o = &pin->places[i];
      if (!abbe_pin_is_other(pin, i)) continue;
      if (now_ns - o->first_ns >= overlap_ns) o->foreign = true;
      o->alone_ns = 0;
    }
    return ABBE_PIN_PINNED;
  }

  p->alone_ns += pause_ns < longest_pause_ns ? pause_ns : longest_pause_ns;
  const enum abbe_pin_verdict objection = abbe_pin_objection(pin, place, now_ns);
  if (objection != ABBE_PIN_PINNED) return objection;
  if (pin->pinned >= 0) {
    struct abbe_pin_place* former = &pin->places[pin->pinned];
    if (now_ns - former->last_ns < pin->silence_ns || p->alone_ns < alone_ns)
      return ABBE_PIN_WAITING;
    former->used = false;
  }
  pin->pinned = place;
  if (p->identified) {
    pin->has_machine_id = true;
    strcpy(pin->machine_id, p->machine_id);
  }
  return ABBE_PIN_NEWLY_PINNED;
}

/* Call it for every received sample of the topic Identity of the machine. The pinned participant is
   released if it states another machine than before. */
static inline enum abbe_pin_verdict abbe_pin_identified(struct abbe_publisher_pin* pin,
                                                        const uint8_t* id, const char* machine_id,
                                                        enum abbe_pin_twin twin, int64_t now_ns) {
  int place = abbe_pin_place_of(pin, id);
  if (place >= 0 && place == pin->pinned &&
      (!pin->has_machine_id || strcmp(pin->machine_id, machine_id) != 0)) {
    pin->places[place].used = false;
    pin->pinned = place = -1;
  }
  if (place < 0) place = abbe_pin_add(pin, id, now_ns);
  struct abbe_pin_place* p = &pin->places[place];
  if (place != pin->pinned) {
    p->identified = true;
    p->twin = twin;
    snprintf(p->machine_id, sizeof p->machine_id, "%s", machine_id);
  }
  return abbe_pin_heard(pin, id, now_ns);
}

#endif
