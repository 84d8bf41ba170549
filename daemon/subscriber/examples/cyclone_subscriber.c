/* Shows how to apply abbe's correction, with Cyclone DDS in C and the types that idlc generates
   from abbe_v1.idl:

     cyclone_subscriber DOMAIN [KEYS] [--machine NAME MACHINE_ID]

   It prints for every Compensation of every machine whether it may be applied, and when one that may
   be applied may no longer be, because nothing newer has arrived. KEYS is the folder
   of one subscriber made by `abbe dds keys`; it is needed if abbed uses keys. With --machine only
   the machine NAME is used, and only if its identity is MACHINE_ID (`abbe machine identity`);
   without it the first machine of each name, and no other one while the program runs. The program
   has one thread; Cyclone DDS calls the listener from another one. */
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
enum { MOST_MACHINES = 256, MOST_PUBLISHERS = 8, MOST_WRITERS = 4096 };

static const int64_t second_ns = INT64_C(1000000000), millisecond_ns = INT64_C(1000000);

/* A publisher whose last ModelState is older counts as not alive: abbe-dds repeats ModelState every
   second, even if nothing in it changes. */
static const int64_t longest_silence_ns = INT64_C(1500000000);

/* --machine NAME MACHINE_ID; NULL: not given. */
static const char *given_name, *given_machine_id;

/* State of one publisher (a DDS participant) of one machine, independent of other publishers. */
struct publisher {
  dds_guid_t participant;
  int64_t first_ns, last_ns; /* times of its samples; last_ns 0: entry is free */
  int64_t alone_ns;          /* time of sending since the last sample of the pinned publisher */
  bool foreign;
  abbe_v1_Identity identity;   /* which machine the publisher is */
  bool identified;             /* `identity` is valid */
  const char* ignored_because; /* NULL: it is not, or not yet known */
  abbe_v1_ModelState state;
  dds_instance_handle_t state_from; /* writer of `state`; 0: there is no valid state */
  int64_t state_received_ns;
  int64_t first_vector_ns, last_vector_ns, least_offset_ns; /* see delay_of(); 0: no vector yet */
  bool inherited;
};

/* One of the machines whose data are published in the domain. Only samples of its pinned publisher
   are used. */
struct machine {
  char machine_id[sizeof(((abbe_v1_Identity*)0)->machine_id)];
  bool has_machine_id; /* `machine_id` was given, or that of the first pinned publisher */
  char name[sizeof(((abbe_v1_ModelState*)0)->machine)];
  struct publisher publishers[MOST_PUBLISHERS];
  struct publisher* pinned;
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
      m->has_machine_id = given_machine_id != NULL;
      if (m->has_machine_id) snprintf(m->machine_id, sizeof m->machine_id, "%s", given_machine_id);
    }
    if (strcmp(m->name, name) == 0) return m;
  }
  return NULL;
}

/* True if two GUIDs are of the same participant: all of its writers share the first 12 bytes of the
   GUID. */
static bool same_participant(const dds_guid_t* a, const dds_guid_t* b) {
  return memcmp(a->v, b->v, 12) == 0;
}

static void print_participant(const char* format, const char* machine, const dds_guid_t* id) {
  char text[27] = "";
  for (int i = 0; i < 12; ++i)
    snprintf(text + strlen(text), sizeof text - strlen(text), "%s%02x", i == 4 || i == 8 ? "." : "",
             id->v[i]);
  printf(format, machine, text);
}

/* The entry of a publisher. If all entries are in use, a new publisher gets the entry whose last
   sample is oldest, but never that of the pinned publisher. The new publisher takes over the delay
   measurement of the pinned one, because its clock is the same if abbe-dds only restarted. */
static struct publisher* find_publisher(struct machine* m, const dds_guid_t* participant) {
  struct publisher* entry = NULL;
  for (struct publisher* p = m->publishers; p < m->publishers + MOST_PUBLISHERS; ++p) {
    if (p->last_ns != 0 && same_participant(&p->participant, participant)) return p;
    if (p != m->pinned && (entry == NULL || p->last_ns < entry->last_ns)) entry = p;
  }
  memset(entry, 0, sizeof *entry);
  entry->participant = *participant;
  entry->first_ns = entry->last_ns = now_in_ns();
  if (m->pinned == NULL) return entry;
  entry->first_vector_ns = m->pinned->first_vector_ns;
  entry->last_vector_ns = m->pinned->last_vector_ns;
  entry->least_offset_ns = m->pinned->least_offset_ns;
  entry->inherited = entry->first_vector_ns != 0;
  return entry;
}

static void print_state(const abbe_v1_ModelState* state) {
  printf("%s: state %d %s\n", state->machine, (int)state->state, state->reason);
}

/* True if the machine has seen another publisher of its name and machine_id. */
static bool is_copied(const abbe_v1_Identity* identity) {
  char copy[sizeof identity->machine + 40];
  snprintf(copy, sizeof copy, "the same machine_id, as machine %s,", identity->machine);
  return identity->twin && strncmp(identity->twin_seen, copy, strlen(copy)) == 0;
}

/* True if a foreign publisher that is there states the identity of `p`: it is then the copy that `p`,
   the restarted publisher, has seen. */
static bool is_of_foreign(const struct machine* m, const struct publisher* p, int64_t now_ns) {
  for (const struct publisher* o = m->publishers; o < m->publishers + MOST_PUBLISHERS; ++o)
    if (o->foreign && o->last_ns != 0 && now_ns - o->last_ns < 1500 * millisecond_ns &&
        o->identified && strcmp(o->identity.machine_id, p->identity.machine_id) == 0)
      return true;
  return false;
}

/* True if another publisher that is neither pinned nor foreign states the same identity as `p`, or
   like `p` none. */
static bool has_copy(const struct machine* m, const struct publisher* p, int64_t now_ns) {
  for (const struct publisher* o = m->publishers; o < m->publishers + MOST_PUBLISHERS; ++o) {
    if (o == p || o == m->pinned || o->foreign || now_ns - o->last_ns >= 1500 * millisecond_ns)
      continue;
    if (o->last_ns != 0 && o->identified == p->identified &&
        strcmp(o->identity.machine_id, p->identity.machine_id) == 0)
      return true;
  }
  return false;
}

/* True if `p` has sent for 5 s without stating an identity, as an abbe-dds of an earlier version
   does, and neither an identity was given nor another publisher states one. */
static bool has_no_identity(const struct machine* m, const struct publisher* p, int64_t now_ns) {
  bool others_have = false;
  for (const struct publisher* o = m->publishers; o < m->publishers + MOST_PUBLISHERS; ++o)
    others_have |= o->last_ns != 0 && o->identified;
  return !p->identified && !m->has_machine_id && !others_have &&
         now_ns - p->first_ns >= 5 * second_ns;
}

/* True if `p`, which is not pinned, may be pinned now. It must be the same machine as before, not
   only have the same name: a publisher of another machine_id is never pinned. Of two machines that
   know of each other (`twin`) none is the first, and of two publishers with one identity (a copied
   disk) none is chosen. A publisher that sent beside the pinned one is foreign, and never pinned.
   Another one replaces the pinned one if that has been silent for 300 ms and the other has sent for
   30 ms since then. Reasons and limits: publisher_pin.hpp and dds.md. */
static bool may_be_pinned(struct machine* m, struct publisher* p, int64_t now_ns) {
  p->ignored_because = NULL;
  if (!p->identified && !has_no_identity(m, p, now_ns)) return false;
  if (p->identified && p->identity.machine_id[0] == '\0')
    p->ignored_because = "%s: without a machine_id, publisher %s is ignored\n";
  else if (m->has_machine_id && strcmp(m->machine_id, p->identity.machine_id) != 0)
    p->ignored_because = "%s: another machine of this name, publisher %s is ignored\n";
  else if ((is_copied(&p->identity) && !is_of_foreign(m, p, now_ns)) ||
           (!p->foreign && has_copy(m, p, now_ns)))
    p->ignored_because = "%s: one of several with one identity, publisher %s is ignored\n";
  else if (!m->has_machine_id && p->identity.twin)
    p->ignored_because = "%s: one of several machines of this name, publisher %s is ignored\n";
  else if (p->foreign)
    p->ignored_because = "%s: another publisher %s is ignored\n";
  if (p->ignored_because != NULL) return false;
  return m->pinned == NULL || (now_ns - m->pinned->last_ns >= 300 * millisecond_ns &&
                               p->alone_ns >= 30 * millisecond_ns);
}

/* True if `p`, which sent a sample now, is the pinned publisher of the machine. */
static bool is_pinned(struct machine* m, struct publisher* p) {
  const int64_t now_ns = now_in_ns(), pause_ns = now_ns - p->last_ns;
  p->last_ns = now_ns;

  if (m->pinned != p) {
    p->alone_ns += pause_ns < 10 * millisecond_ns ? pause_ns : 10 * millisecond_ns;
    if (!may_be_pinned(m, p, now_ns)) return false;
    if (m->pinned != NULL) m->pinned->last_ns = 0; /* frees the entry */
    m->pinned = p;
    m->has_machine_id |= p->identified;
    if (p->identified) strcpy(m->machine_id, p->identity.machine_id);
    print_participant(p->identified ? "%s: publisher is %s\n"
                                    : "%s: publisher is %s, an abbe-dds of an earlier version "
                                      "without identity\n",
                      m->name, &p->participant);
    if (p->state_from != 0) print_state(&p->state);
  }

  for (struct publisher* other = m->publishers; other < m->publishers + MOST_PUBLISHERS; ++other) {
    if (other == p || other->last_ns == 0) continue;
    other->foreign |= now_ns - other->first_ns >= 100 * millisecond_ns;
    other->alone_ns = 0;
  }
  return true;
}

static void report_ignored_publisher(struct machine* m, const struct publisher* p) {
  const int64_t now_ns = now_in_ns();
  if (p->ignored_because == NULL ||
      (m->ignored_reported_ns != 0 && now_ns - m->ignored_reported_ns < 10 * second_ns))
    return;
  m->ignored_reported_ns = now_ns;
  print_participant(p->ignored_because, m->name, &p->participant);
}

/* The publisher of a sample; NULL if the writer of the sample does not exist any more. */
static struct publisher* publisher_of(struct machine* m, dds_entity_t reader,
                                      dds_instance_handle_t writer) {
  dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader, writer);
  if (m == NULL || endpoint == NULL) {
    if (endpoint != NULL) dds_builtintopic_free_endpoint(endpoint);
    return NULL;
  }
  struct publisher* p = find_publisher(m, &endpoint->participant_key);
  dds_builtintopic_free_endpoint(endpoint);
  return p;
}

/* Discards the ModelState of every writer that is not alive. A writer that becomes alive again
   repeats its ModelState within a second. */
static void discard_dead_states(void) {
  for (struct machine* m = machines; m < machines + MOST_MACHINES; ++m) {
    for (struct publisher* p = m->publishers; p < m->publishers + MOST_PUBLISHERS; ++p) {
      const bool recent = now_in_ns() - p->state_received_ns < longest_silence_ns;
      if (p->state_from == 0 || (recent && is_alive(p->state_from))) continue;
      p->state_from = 0;
      if (p == m->pinned) printf("%s: not alive\n", m->name);
    }
  }
}

/* Delay of a vector from publication to now, relative to the fastest vector of its publisher. The
   delay includes the network and the time in the socket while this process was suspended. The
   clocks of the two computers may differ in offset, and in rate by 200 ppm. A measurement that was
   taken over from another publisher is kept if clock offset plus transit time of the first vector
   differ from it by at most 20 ms. */
static int64_t delay_of(const abbe_v1_Compensation* c, struct publisher* p) {
  const int64_t now_ns = now_in_ns(), since_last_ns = now_ns - p->last_vector_ns;
  const int64_t offset_ns = now_ns - (c->host_time_ns + c->age_ns);
  const bool same_clock = llabs(offset_ns - p->least_offset_ns) <= 20 * millisecond_ns;
  if (p->inherited && !same_clock) p->first_vector_ns = 0;
  p->inherited = false;
  p->least_offset_ns += (since_last_ns < second_ns ? since_last_ns : second_ns) / 5000;
  if (p->first_vector_ns == 0 || offset_ns < p->least_offset_ns) p->least_offset_ns = offset_ns;
  if (p->first_vector_ns == 0) p->first_vector_ns = now_ns;
  p->last_vector_ns = now_ns;
  return offset_ns - p->least_offset_ns;
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
  if (p->last_vector_ns - p->first_vector_ns <= second_ns / 5)
    return "the reference delay is not known yet";
  if (age_ns > c->validity_ns) return "too old";
  return NULL;
}

/* Keeps a ModelState, also one from a publisher that is not pinned, because it may be pinned
   later. */
static void keep(const abbe_v1_ModelState* state, dds_entity_t reader,
                 dds_instance_handle_t writer) {
  struct machine* m = find_machine(state->machine);
  struct publisher* p = publisher_of(m, reader, writer);
  if (p == NULL) return;
  p->state = *state;
  p->state_from = writer;
  p->state_received_ns = now_in_ns();
  if (!is_pinned(m, p)) {
    report_ignored_publisher(m, p);
    return;
  }
  print_state(state);
}

/* Which machine a publisher is. The pinned publisher is released if abbed behind it has become
   another machine. */
static void identify(const abbe_v1_Identity* identity, dds_entity_t reader,
                     dds_instance_handle_t writer) {
  struct machine* m = find_machine(identity->machine);
  struct publisher* p = publisher_of(m, reader, writer);
  if (p == NULL) return;
  p->identity = *identity;
  p->identified = true;
  if (m->pinned == p && (!m->has_machine_id || strcmp(m->machine_id, identity->machine_id) != 0))
    m->pinned = NULL;
  if (!is_pinned(m, p)) report_ignored_publisher(m, p);
}

static void decide(const abbe_v1_Compensation* c, dds_entity_t reader,
                   dds_instance_handle_t writer) {
  struct machine* m = find_machine(c->machine);
  struct publisher* p = publisher_of(m, reader, writer);
  if (p == NULL) return;
  const int64_t age_ns = c->age_ns + delay_of(c, p);
  if (!is_pinned(m, p)) {
    report_ignored_publisher(m, p);
    return;
  }
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
    const char* reason = m->pinned == NULL
                             ? "the publisher states another machine"
                             : why_not(&m->applied, m->applied_age_ns + since_ns, m->pinned);
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

int main(int argc, char** argv) {
  setvbuf(stdout, NULL, _IOLBF, 0);
  if (argc > 3 && strcmp(argv[argc - 3], "--machine") == 0) {
    given_name = argv[argc - 2];
    given_machine_id = argv[argc - 1];
    argc -= 3;
  }
  const dds_domainid_t domain = argc > 1 ? (dds_domainid_t)atoi(argv[1]) : 0;
  if (argc > 2) configure_for_keys(domain);
  dds_qos_t* participant_qos = argc > 2 ? qos_with_keys(argv[2]) : NULL;
  dds_entity_t participant = dds_create_participant(domain, participant_qos, NULL);
  dds_delete_qos(participant_qos);
  if (participant < 0) return 4;
  dds_entity_t identities = read_identity(participant), states = read_state(participant),
               vectors = read_compensation(participant);
  if (identities < 0 || states < 0 || vectors < 0) return 4;

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
        if (info.valid_data) identify(identity, identities, info.publication_handle);
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
