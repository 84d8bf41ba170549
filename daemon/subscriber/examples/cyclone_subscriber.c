/* Shows how to apply abbe's correction, with Cyclone DDS in C and the types that idlc generates
   from abbe_v1.idl:

     cyclone_subscriber DOMAIN [KEYS] [--machine NAME MACHINE_ID]

   It prints for every Compensation of every machine whether it may be applied, and when one that may
   be applied may no longer be, because nothing newer has arrived. KEYS is the folder
   of one subscriber made by `abbe dds keys`; it is needed if abbed uses keys. With --machine only
   the machine NAME is used, and only if its identity is MACHINE_ID (`abbe machine identity`);
   without it the first machine of each name, and no other one while the program runs. The program
   has one thread; Cyclone DDS calls the listener from another one. As a last defence against
   strangers limit the memory of the process, for example with MemoryMax= of its systemd unit.

   Exit codes: 2 a wrong argument, 4 Cyclone DDS refuses. */
#include <abbe/subscriber/publisher_pin.h>
#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "abbe_v1.h"
#include "dds/dds.h"

/* Strangers may make up machines and writers; they cannot take the place of a given machine. */
enum { MOST_MACHINES = 256, MOST_WRITERS = 4096 };

/* The ports of higher domains do not exist. */
enum { HIGHEST_DOMAIN = 232 };

static const int64_t second_ns = INT64_C(1000000000), millisecond_ns = INT64_C(1000000);

/* A publisher whose last ModelState is older counts as not alive: abbe-dds repeats ModelState every
   second, even if nothing in it changes. */
static const int64_t longest_silence_ns = INT64_C(1500000000);

/* --machine NAME MACHINE_ID; NULL: not given. */
static const char *given_name, *given_machine_id;

/* Delay of vectors, see delay_of(). */
struct delay {
  int64_t first_ns, last_ns; /* times of vectors; 0: no vector yet */
  int64_t least_offset_ns;
  bool inherited;
};

/* State of one publisher (a DDS participant) of one machine, independent of other publishers. */
struct publisher {
  int64_t since_ns; /* first_ns of its place in the pin */
  abbe_v1_ModelState state;
  dds_instance_handle_t state_from; /* writer of `state`; 0: there is no valid state */
  int64_t state_received_ns;
  struct delay delay;
};

/* One of the machines whose data are published in the domain. Only samples of its pinned publisher
   are used (publisher_pin.h). */
struct machine {
  char name[sizeof(((abbe_v1_ModelState*)0)->machine)];
  struct abbe_publisher_pin pin;
  struct publisher publishers[ABBE_PIN_PLACES]; /* by their places in `pin` */
  int64_t ignored_reported_ns;
  abbe_v1_Compensation applied; /* the last vector, while it may be applied */
  int64_t applied_age_ns;       /* when it arrived */
  int64_t applied_ns;           /* its arrival; 0: none may be applied */
};
static struct machine machines[MOST_MACHINES];

/* Writers of ModelState that are alive (DDS liveliness); 0: entry is free. */
static dds_instance_handle_t alive[MOST_WRITERS];
static pthread_mutex_t alive_lock = PTHREAD_MUTEX_INITIALIZER;

static void replace_writer(dds_instance_handle_t old, dds_instance_handle_t with) {
  for (int i = 0; i < MOST_WRITERS; ++i) {
    if (alive[i] != old) continue;
    alive[i] = with;
    return;
  }
}

/* Called by Cyclone DDS when the liveliness of one writer of ModelState changes. */
static void liveliness_changed(dds_entity_t reader, const dds_liveliness_changed_status_t status,
                               void* arg) {
  (void)reader, (void)arg;
  pthread_mutex_lock(&alive_lock);
  if (status.alive_count_change > 0) replace_writer(0, status.last_publication_handle);
  if (status.alive_count_change < 0) replace_writer(status.last_publication_handle, 0);
  pthread_mutex_unlock(&alive_lock);
}

static bool is_alive(dds_instance_handle_t writer) {
  bool found = false;
  pthread_mutex_lock(&alive_lock);
  for (int i = 0; i < MOST_WRITERS; ++i) found |= writer != 0 && alive[i] == writer;
  pthread_mutex_unlock(&alive_lock);
  return found;
}

static int64_t now_in_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

/* The entry of a machine, added if new; NULL if there are MOST_MACHINES others already, another
   machine was given, or it has no name. */
static struct machine* find_machine(const char* name) {
  if (name[0] == '\0' || (given_name != NULL && strcmp(given_name, name) != 0)) return NULL;
  for (int i = 0; i < MOST_MACHINES; ++i) {
    struct machine* m = &machines[i];
    if (m->name[0] == '\0') {
      strcpy(m->name, name);
      abbe_pin_init(&m->pin, given_machine_id, abbe_pin_silence_ns);
    }
    if (strcmp(m->name, name) == 0) return m;
  }
  return NULL;
}

/* Prints the GUID prefix of a participant as Fast DDS and Cyclone DDS do. */
static void print_participant(const char* before, const uint8_t* id, const char* behind) {
  char text[27] = "";
  for (int i = 0; i < ABBE_PIN_ID_BYTES; ++i)
    snprintf(text + strlen(text), sizeof text - strlen(text), "%s%02x", i == 4 || i == 8 ? "." : "",
             id[i]);
  printf("%s %s%s\n", before, text, behind);
}

static void print_state(const abbe_v1_ModelState* state) {
  printf("%s: state %d %s\n", state->machine, (int)state->state, state->reason);
}

/* What is reported of a publisher that is not used; NULL: nothing. */
static const char* ignored_because(enum abbe_pin_verdict verdict) {
  switch (verdict) {
    case ABBE_PIN_FOREIGN:
      return "another publisher";
    case ABBE_PIN_OTHER_MACHINE:
      return "another machine of this name, publisher";
    case ABBE_PIN_AMBIGUOUS:
      return "one of several machines of this name, publisher";
    case ABBE_PIN_COPIED:
      return "one of several with one identity, publisher";
    case ABBE_PIN_UNIDENTIFIED:
      return "without a machine_id, publisher";
    default:
      return NULL;
  }
}

static void report(struct machine* m, enum abbe_pin_verdict verdict, const uint8_t* id) {
  const int64_t now_ns = now_in_ns();
  const char* reason = ignored_because(verdict);
  char text[sizeof m->name + 64];
  if (verdict == ABBE_PIN_NEWLY_PINNED) {
    snprintf(text, sizeof text, "%s: publisher is", m->name);
    print_participant(
        text, id,
        m->pin.has_machine_id ? "" : ", an abbe-dds of an earlier version without identity");
  } else if (reason != NULL &&
             (m->ignored_reported_ns == 0 || now_ns - m->ignored_reported_ns >= 10 * second_ns)) {
    m->ignored_reported_ns = now_ns;
    snprintf(text, sizeof text, "%s: %s", m->name, reason);
    print_participant(text, id, " is ignored");
  }
}

/* The publisher of a sample. `identity`: the sample, if it is an Identity. NULL if the machine has
   no entry or the writer of the sample does not exist any more. A new publisher takes over the delay
   measurement of the pinned one, because its clock is the same if abbe-dds only restarted. */
static struct publisher* heard(struct machine* m, dds_entity_t reader, dds_instance_handle_t writer,
                               const abbe_v1_Identity* identity) {
  if (m == NULL) return NULL;
  dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader, writer);
  if (endpoint == NULL) return NULL;
  uint8_t id[ABBE_PIN_ID_BYTES];
  memcpy(id, endpoint->participant_key.v, sizeof id);
  dds_builtintopic_free_endpoint(endpoint);

  const int former = m->pin.pinned;
  const enum abbe_pin_verdict verdict =
      identity == NULL ? abbe_pin_heard(&m->pin, id, now_in_ns())
                       : abbe_pin_identified(&m->pin, id, identity->machine_id,
                                             abbe_pin_twin_of(identity->twin, identity->twin_seen,
                                                              identity->machine),
                                             now_in_ns());
  const int place = abbe_pin_place_of(&m->pin, id);
  struct publisher* p = &m->publishers[place];
  if (p->since_ns != m->pin.places[place].first_ns) {
    struct delay delay = {0, 0, 0, false};
    if (former >= 0) delay = m->publishers[former].delay;
    delay.inherited = delay.first_ns != 0;
    memset(p, 0, sizeof *p);
    p->since_ns = m->pin.places[place].first_ns;
    p->delay = delay;
  }
  report(m, verdict, id);
  if (verdict == ABBE_PIN_NEWLY_PINNED && p->state_from != 0) print_state(&p->state);
  return p;
}

/* The publisher whose samples are used; NULL: none. */
static struct publisher* pinned_of(struct machine* m) {
  return m->pin.pinned < 0 ? NULL : &m->publishers[m->pin.pinned];
}

/* Discards the ModelState of every writer that is not alive. A writer that becomes alive again
   repeats its ModelState within a second. */
static void discard_dead_states(void) {
  for (struct machine* m = machines; m < machines + MOST_MACHINES; ++m) {
    for (struct publisher* p = m->publishers; p < m->publishers + ABBE_PIN_PLACES; ++p) {
      const bool recent = now_in_ns() - p->state_received_ns < longest_silence_ns;
      if (p->state_from == 0 || (recent && is_alive(p->state_from))) continue;
      p->state_from = 0;
      if (p == pinned_of(m)) printf("%s: not alive\n", m->name);
    }
  }
}

/* Delay of a vector from publication to now, relative to the fastest vector of its publisher. The
   delay includes the network and the time in the socket while this process was suspended. The
   clocks of the two computers may differ in offset, and in rate by 200 ppm. A measurement that was
   taken over from another publisher is kept if clock offset plus transit time of the first vector
   differ from it by at most 20 ms. */
static int64_t delay_of(const abbe_v1_Compensation* c, struct delay* d) {
  const int64_t now_ns = now_in_ns(), since_last_ns = now_ns - d->last_ns;
  const int64_t offset_ns = now_ns - (c->host_time_ns + c->age_ns);
  const bool same_clock = llabs(offset_ns - d->least_offset_ns) <= 20 * millisecond_ns;
  if (d->inherited && !same_clock) d->first_ns = 0;
  d->inherited = false;
  d->least_offset_ns += (since_last_ns < second_ns ? since_last_ns : second_ns) / 5000;
  if (d->first_ns == 0 || offset_ns < d->least_offset_ns) d->least_offset_ns = offset_ns;
  if (d->first_ns == 0) d->first_ns = now_ns;
  d->last_ns = now_ns;
  return offset_ns - d->least_offset_ns;
}

/* The rule of abbe_v1.idl: NULL if the vector may be applied, else the reason. age_ns: age of the
   vector including the delay after its publication. */
static const char* why_not(const abbe_v1_Compensation* c, int64_t age_ns,
                           const struct publisher* p) {
  if (!is_alive(p->state_from)) return "the ModelState publisher is not alive";
  if (p->state.state != abbe_v1_MODEL_ACTIVE || c->state != abbe_v1_MODEL_ACTIVE)
    return "the model is not ACTIVE";
  if (strcmp(c->model_id, p->state.model_id) != 0) return "the vector is of another model";
  if (!c->inside) return "outside the volume of the calibration data";
  if (!c->tool_ok) return "the model is not valid for this tool";
  /* The fastest vector of the first 0.2 s serves as the reference; before that all vectors may have
     been late. */
  if (p->delay.last_ns - p->delay.first_ns <= second_ns / 5)
    return "the reference delay is not known yet";
  if (age_ns > c->validity_ns) return "too old";
  return NULL;
}

/* Keeps a ModelState, also one from a publisher that is not pinned, because it may be pinned
   later. */
static void keep(const abbe_v1_ModelState* state, dds_entity_t reader,
                 dds_instance_handle_t writer) {
  struct machine* m = find_machine(state->machine);
  struct publisher* p = heard(m, reader, writer, NULL);
  if (p == NULL) return;
  p->state = *state;
  p->state_from = writer;
  p->state_received_ns = now_in_ns();
  if (p == pinned_of(m)) print_state(state);
}

static void decide(const abbe_v1_Compensation* c, dds_entity_t reader,
                   dds_instance_handle_t writer) {
  struct machine* m = find_machine(c->machine);
  struct publisher* p = heard(m, reader, writer, NULL);
  if (p == NULL) return;
  const int64_t age_ns = c->age_ns + delay_of(c, &p->delay);
  if (p != pinned_of(m)) return;
  const char* reason = why_not(c, age_ns, p);
  m->applied_ns = 0;
  if (reason != NULL) {
    printf("%s: do not apply: %s\n", c->machine, reason);
  } else {
    m->applied = *c;
    m->applied_age_ns = age_ns;
    m->applied_ns = now_in_ns();
    printf("%s: apply V = %.3f %.3f %.3f um, %.3f ms old\n", c->machine, c->vector_m[0] * 1e6,
           c->vector_m[1] * 1e6, c->vector_m[2] * 1e6, (double)age_ns * 1e-6);
  }
}

/* Call it every few milliseconds: a publisher that has ended sends nothing more, so that no sample
   shows that its last vector may not be applied any more. */
static void withdraw(void) {
  for (struct machine* m = machines; m < machines + MOST_MACHINES; ++m) {
    if (m->applied_ns == 0) continue;
    const int64_t since_ns = now_in_ns() - m->applied_ns;
    const struct publisher* p = pinned_of(m);
    const char* reason = p == NULL ? "the publisher states another machine"
                                   : why_not(&m->applied, m->applied_age_ns + since_ns, p);
    if (reason == NULL) continue;
    printf("%s: do not apply: %s\n", m->name, reason);
    m->applied_ns = 0;
  }
}

static void set_plugin(dds_qos_t* qos, const char* kind, const char* library,
                       const char* function) {
  char name[64], value[64];
  snprintf(name, sizeof name, "dds.sec.%s.library.path", kind);
  dds_qset_prop(qos, name, library);
  snprintf(name, sizeof name, "dds.sec.%s.library.init", kind);
  snprintf(value, sizeof value, "init_%s", function);
  dds_qset_prop(qos, name, value);
  snprintf(name, sizeof name, "dds.sec.%s.library.finalize", kind);
  snprintf(value, sizeof value, "finalize_%s", function);
  dds_qset_prop(qos, name, value);
}

static void set_file(dds_qos_t* qos, const char* name, const char* folder, const char* file) {
  char value[4200];
  snprintf(value, sizeof value, "file:%s/%s", folder, file);
  dds_qset_prop(qos, name, value);
}

/* Switches DDS Security on: only participants with keys of the same authority can then publish to
   this participant or read from it. */
static dds_qos_t* qos_with_keys(const char* folder) {
  dds_qos_t* qos = dds_create_qos();
  set_plugin(qos, "auth", "dds_security_auth", "authentication");
  set_plugin(qos, "access", "dds_security_ac", "access_control");
  set_plugin(qos, "crypto", "dds_security_crypto", "crypto");
  set_file(qos, "dds.sec.auth.identity_ca", folder, "identity_ca.crt");
  set_file(qos, "dds.sec.auth.identity_certificate", folder, "identity.crt");
  set_file(qos, "dds.sec.auth.private_key", folder, "identity.key");
  set_file(qos, "dds.sec.access.permissions_ca", folder, "permissions_ca.crt");
  set_file(qos, "dds.sec.access.governance", folder, "governance.p7s");
  set_file(qos, "dds.sec.access.permissions", folder, "permissions.p7s");
  return qos;
}

/* Sets lease and announcement period for use with keys. If only one of two participants drops the
   other in a network outage, the one that did not does not authenticate again. Therefore both need
   the same lease: that of abbe-dds, 40 s. By default Cyclone DDS announces itself 2 s before its
   lease ends, at least every 30 s; here it does so every second. Other settings of CYCLONEDDS_URI
   remain valid. */
static void configure_for_keys(dds_domainid_t domain) {
  const char* given = getenv("CYCLONEDDS_URI");
  char config[8192];
  snprintf(config, sizeof config,
           "%s%s<Discovery><LeaseDuration>40s</LeaseDuration>"
           "<SPDPInterval>1s</SPDPInterval></Discovery>",
           given != NULL ? given : "", given != NULL ? "," : "");
  if (dds_create_domain(domain, config) < 0)
    fputs("Cyclone DDS does not accept the configuration\n", stderr);
}

/* ModelState is reliable and retained for late joiners; its writer must assert liveliness every
   second. */
static dds_entity_t read_state(dds_entity_t participant) {
  dds_entity_t topic =
      dds_create_topic(participant, &abbe_v1_ModelState_desc, "abbe/v1/ModelState", NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_liveliness(qos, DDS_LIVELINESS_MANUAL_BY_TOPIC, DDS_SECS(1));
  dds_listener_t* listener = dds_create_listener(NULL);
  dds_lset_liveliness_changed(listener, liveliness_changed);
  dds_entity_t reader = dds_create_reader(participant, topic, qos, listener);
  dds_delete_listener(listener);
  dds_delete_qos(qos);
  return reader;
}

/* Identity is reliable and retained for late joiners. */
static dds_entity_t read_identity(dds_entity_t participant) {
  dds_entity_t topic =
      dds_create_topic(participant, &abbe_v1_Identity_desc, "abbe/v1/Identity", NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return reader;
}

static dds_entity_t read_compensation(dds_entity_t participant) {
  dds_entity_t topic =
      dds_create_topic(participant, &abbe_v1_Compensation_desc, "abbe/v1/Compensation", NULL, NULL);
  return dds_create_reader(participant, topic, NULL, NULL); /* best effort, volatile, keep last 1 */
}

/* A decimal number up to HIGHEST_DOMAIN; -1: `text` is none. */
static int domain_of(const char* text) {
  char* end = NULL;
  errno = 0;
  const long domain = strtol(text, &end, 10);
  const bool number = text[0] >= '0' && text[0] <= '9' && *end == '\0' && errno == 0;
  return number && domain <= HIGHEST_DOMAIN ? (int)domain : -1;
}

static int refuse_arguments(const char* why) {
  fprintf(stderr,
          "cyclone_subscriber: %s\n"
          "usage: cyclone_subscriber DOMAIN [KEYS] [--machine NAME MACHINE_ID]\n",
          why);
  return 2;
}

int main(int argc, char** argv) {
  setvbuf(stdout, NULL, _IOLBF, 0);
  if (argc > 3 && strcmp(argv[argc - 3], "--machine") == 0) {
    struct abbe_publisher_pin pin;
    given_name = argv[argc - 2];
    given_machine_id = argv[argc - 1];
    argc -= 3;
    if (!abbe_pin_init(&pin, given_machine_id, abbe_pin_silence_ns) || !pin.has_machine_id)
      return refuse_arguments("MACHINE_ID is not the identity of a machine");
  }
  if (argc < 2 || argc > 3) return refuse_arguments("wrong number of arguments");
  const int domain = domain_of(argv[1]);
  if (domain < 0) return refuse_arguments("DOMAIN is not a number from 0 to 232");
  if (argc > 2) configure_for_keys((dds_domainid_t)domain);
  dds_qos_t* participant_qos = argc > 2 ? qos_with_keys(argv[2]) : NULL;
  dds_entity_t participant = dds_create_participant((dds_domainid_t)domain, participant_qos, NULL);
  dds_delete_qos(participant_qos);
  if (participant < 0) {
    fprintf(stderr, "cyclone_subscriber: cannot join domain %d: %s\n", domain,
            dds_strretcode(participant));
    return 4;
  }
  dds_entity_t identities = read_identity(participant), states = read_state(participant),
               vectors = read_compensation(participant);
  if (identities < 0 || states < 0 || vectors < 0) {
    fputs("cyclone_subscriber: cannot read the topics\n", stderr);
    return 4;
  }

  abbe_v1_Identity* identity = abbe_v1_Identity__alloc();
  abbe_v1_ModelState* state = abbe_v1_ModelState__alloc();
  abbe_v1_Compensation* vector = abbe_v1_Compensation__alloc();
  dds_sample_info_t info;
  dds_entity_t waitset = dds_create_waitset(participant);
  dds_waitset_attach(waitset, dds_create_readcondition(identities, DDS_ANY_STATE), 0);
  dds_waitset_attach(waitset, dds_create_readcondition(states, DDS_ANY_STATE), 0);
  dds_waitset_attach(waitset, dds_create_readcondition(vectors, DDS_ANY_STATE), 0);
  puts("waiting");
  for (;;) {
    dds_waitset_wait(waitset, NULL, 0, DDS_MSECS(5));
    discard_dead_states();
    /* The identities that have arrived by then come before each other sample. */
    for (bool any = true; any;) {
      any = false;
      while (dds_take(identities, (void**)&identity, &info, 1, 1) > 0) {
        if (info.valid_data)
          heard(find_machine(identity->machine), identities, info.publication_handle, identity);
      }
      if (dds_take(states, (void**)&state, &info, 1, 1) > 0) {
        any = true;
        if (info.valid_data) keep(state, states, info.publication_handle);
      } else if (dds_take(vectors, (void**)&vector, &info, 1, 1) > 0) {
        any = true;
        if (info.valid_data) decide(vector, vectors, info.publication_handle);
      }
    }
    withdraw();
  }
}
