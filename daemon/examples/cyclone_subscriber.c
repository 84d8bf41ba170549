/* How to apply abbe's correction, with Cyclone DDS in C and the types idlc makes of abbe_v1.idl:
     cyclone_subscriber DOMAIN [KEYS]
   prints for every Compensation of every machine whether it may be applied. KEYS is the folder of one
   subscriber that `abbe dds keys` made, where abbed has keys, too. One thread; Cyclone DDS calls the listener
   from another. */
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "abbe_v1.h"
#include "dds/dds.h"

enum { MOST_MACHINES = 16, MOST_PUBLISHERS = 8, MOST_WRITERS = 32 };

static const int64_t second_ns = INT64_C(1000000000), millisecond_ns = INT64_C(1000000);

/* ModelState is repeated every second, also if nothing changes. */
static const int64_t longest_silence_ns = INT64_C(1500000000);

/* What one DDS participant says about one machine. It lives and dies for itself. */
struct publisher {
  dds_guid_t participant;
  int64_t first_ns, last_ns; /* of its samples; last_ns 0: free */
  int64_t alone_ns;          /* it sent since the last sample of the pinned publisher */
  bool foreign;
  abbe_v1_ModelState state;
  dds_instance_handle_t state_from; /* its writer; 0: no state counts */
  int64_t state_heard_ns;
  int64_t first_vector_ns, last_vector_ns, least_offset_ns; /* see delay_of(); 0: no vector yet */
  bool inherited;
};

/* There may be several machines in a domain. Only what the pinned publisher says is used. */
struct machine {
  char name[sizeof(((abbe_v1_ModelState*)0)->machine)];
  struct publisher publishers[MOST_PUBLISHERS];
  struct publisher* pinned;
  int64_t rival_reported_ns;
};
static struct machine machines[MOST_MACHINES];

/* Writers of ModelState that keep their lease; 0 is free. */
static dds_instance_handle_t alive[MOST_WRITERS];
static pthread_mutex_t alive_lock = PTHREAD_MUTEX_INITIALIZER;

static void replace_writer(dds_instance_handle_t old, dds_instance_handle_t with) {
  for (int i = 0; i < MOST_WRITERS; ++i) {
    if (alive[i] != old) continue;
    alive[i] = with;
    return;
  }
}

/* Called for every change of one writer. */
static void liveliness_changed(dds_entity_t reader, const dds_liveliness_changed_status_t status, void* arg) {
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

/* NULL: more machines than we have room for. */
static struct machine* find_machine(const char* name) {
  for (int i = 0; i < MOST_MACHINES; ++i) {
    if (machines[i].name[0] == '\0') strcpy(machines[i].name, name);
    if (strcmp(machines[i].name, name) == 0) return &machines[i];
  }
  return NULL;
}

/* All writers of a participant share the first 12 bytes of its GUID. */
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

/* A new one takes the place of the one heard longest ago, but not of the pinned one. Its vectors are measured
   against those of the pinned one, which after a restart had the same clock. */
static struct publisher* find_publisher(struct machine* m, const dds_guid_t* participant) {
  struct publisher* place = NULL;
  for (struct publisher* p = m->publishers; p < m->publishers + MOST_PUBLISHERS; ++p) {
    if (p->last_ns != 0 && same_participant(&p->participant, participant)) return p;
    if (p != m->pinned && (place == NULL || p->last_ns < place->last_ns)) place = p;
  }
  memset(place, 0, sizeof *place);
  place->participant = *participant;
  place->first_ns = place->last_ns = now_in_ns();
  if (m->pinned == NULL) return place;
  place->first_vector_ns = m->pinned->first_vector_ns;
  place->last_vector_ns = m->pinned->last_vector_ns;
  place->least_offset_ns = m->pinned->least_offset_ns;
  place->inherited = place->first_vector_ns != 0;
  return place;
}

/* The publisher a sample came from counts for the machine: it is the one heard first, or the one before has
   been silent for 300 ms (10 s for a foreign, which sent beside it) while this one sent for 30 ms. Reasons and
   limits are in publisher_pin.hpp and dds.md. */
static bool is_pinned(struct machine* m, struct publisher* p) {
  const int64_t now_ns = now_in_ns(), pause_ns = now_ns - p->last_ns;
  p->last_ns = now_ns;
  if (m->pinned != p) {
    const int64_t silence_ns = m->pinned == NULL ? INT64_MAX : now_ns - m->pinned->last_ns;
    p->alone_ns += pause_ns < 10 * millisecond_ns ? pause_ns : 10 * millisecond_ns;
    const bool next = silence_ns >= (p->foreign ? 10 * second_ns : 300 * millisecond_ns) &&
                      p->alone_ns >= 30 * millisecond_ns;
    if (!next && m->pinned != NULL) return false;
    if (m->pinned != NULL) m->pinned->last_ns = 0; /* forgotten */
    m->pinned = p;
    p->foreign = false;
    print_participant("%s: publisher is %s\n", m->name, &p->participant);
  }
  for (struct publisher* other = m->publishers; other < m->publishers + MOST_PUBLISHERS; ++other) {
    if (other == p || other->last_ns == 0) continue;
    other->foreign |= now_ns - other->first_ns >= 100 * millisecond_ns;
    other->alone_ns = 0;
  }
  return true;
}

static void report_foreign_sync(struct machine* m, const struct publisher* p) {
  const int64_t now_ns = now_in_ns();
  if (!p->foreign || (m->rival_reported_ns != 0 && now_ns - m->rival_reported_ns < 10 * second_ns)) return;
  m->rival_reported_ns = now_ns;
  print_participant("%s: rival publisher %s is ignored\n", m->name, &p->participant);
}

/* The publisher of a sample; NULL: its writer has gone already. */
static struct publisher* publisher_of(struct machine* m, dds_entity_t reader, dds_instance_handle_t writer) {
  dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader, writer);
  if (m == NULL || endpoint == NULL) {
    if (endpoint != NULL) dds_builtintopic_free_endpoint(endpoint);
    return NULL;
  }
  struct publisher* p = find_publisher(m, &endpoint->participant_key);
  dds_builtintopic_free_endpoint(endpoint);
  return p;
}

/* What a lost writer said counts no longer, also when it comes back: it repeats its state within a second. */
static void forget_the_dead(void) {
  for (struct machine* m = machines; m < machines + MOST_MACHINES; ++m) {
    for (struct publisher* p = m->publishers; p < m->publishers + MOST_PUBLISHERS; ++p) {
      const bool heard = now_in_ns() - p->state_heard_ns < longest_silence_ns;
      if (p->state_from == 0 || (heard && is_alive(p->state_from))) continue;
      p->state_from = 0;
      if (p == m->pinned) printf("%s: not alive\n", m->name);
    }
  }
}

/* How much longer a vector was on its way than the quickest one of its publisher: in the network, in a socket
   while this process stood still, until we looked. The two clocks need not agree; they may drift apart by
   200 ppm. What was measured before of another publisher holds if the first vector is within 20 ms of it. */
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

/* The rule of abbe_v1.idl. age_ns: with what the vector waited since it was published. */
static const char* why_not(const abbe_v1_Compensation* c, int64_t age_ns, const struct publisher* p) {
  if (!is_alive(p->state_from)) return "the ModelState publisher is not alive";
  if (p->state.state != abbe_v1_MODEL_ACTIVE || c->state != abbe_v1_MODEL_ACTIVE)
    return "the model is not ACTIVE";
  if (strcmp(c->model_id, p->state.model_id) != 0) return "the vector is of another model";
  if (!c->inside) return "outside the volume the data covered";
  if (!c->tool_ok) return "the model does not hold for this tool";
  /* The quickest vector of the first 0.2 s is the measure: those before may all have waited. */
  if (p->last_vector_ns - p->first_vector_ns <= second_ns / 5)
    return "how quick the way can be is not known yet";
  if (age_ns > c->validity_ns) return "too old";
  return NULL;
}

/* Also of a publisher that is not pinned: it may be the next one. */
static void keep(const abbe_v1_ModelState* state, dds_entity_t reader, dds_instance_handle_t writer) {
  struct machine* m = find_machine(state->machine);
  struct publisher* p = publisher_of(m, reader, writer);
  if (p == NULL) return;
  p->state = *state;
  p->state_from = writer;
  p->state_heard_ns = now_in_ns();
  if (!is_pinned(m, p)) {
    report_foreign_sync(m, p);
    return;
  }
  printf("%s: state %d %s\n", state->machine, (int)state->state, state->reason);
}

static void decide(const abbe_v1_Compensation* c, dds_entity_t reader, dds_instance_handle_t writer) {
  struct machine* m = find_machine(c->machine);
  struct publisher* p = publisher_of(m, reader, writer);
  if (p == NULL) return;
  const int64_t age_ns = c->age_ns + delay_of(c, p);
  if (!is_pinned(m, p)) {
    report_foreign_sync(m, p);
    return;
  }
  const char* reason = why_not(c, age_ns, p);
  if (reason != NULL) {
    printf("%s: do not apply: %s\n", c->machine, reason);
  } else {
    printf("%s: apply V = %.3f %.3f %.3f um, %.3f ms old\n", c->machine, c->vector_m[0] * 1e6,
           c->vector_m[1] * 1e6, c->vector_m[2] * 1e6, (double)age_ns * 1e-6);
  }
}

static void set_plugin(dds_qos_t* qos, const char* kind, const char* library, const char* function) {
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

/* DDS Security: who has no keys of the same authority can neither publish to us nor read. */
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

/* Which of two participants dropped the other in an outage must not matter: with keys the one that was not
   dropped does not authenticate again. So the lease is that of abbe-dds, 40 s. Cyclone DDS announces itself
   2 s before its lease ends, at the latest every 30 s: here every second. What CYCLONEDDS_URI gives stays in
   force for the rest. */
static void configure_for_keys(dds_domainid_t domain) {
  const char* given = getenv("CYCLONEDDS_URI");
  char config[8192];
  snprintf(config, sizeof config,
           "%s%s<Discovery><LeaseDuration>40s</LeaseDuration><SPDPInterval>1s</SPDPInterval></Discovery>",
           given != NULL ? given : "", given != NULL ? "," : "");
  if (dds_create_domain(domain, config) < 0) fputs("Cyclone DDS does not accept the configuration\n", stderr);
}

/* ModelState is reliable, kept for late joiners, and its writer must say within a second that it is alive. */
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

static dds_entity_t read_compensation(dds_entity_t participant) {
  dds_entity_t topic =
      dds_create_topic(participant, &abbe_v1_Compensation_desc, "abbe/v1/Compensation", NULL, NULL);
  return dds_create_reader(participant, topic, NULL, NULL); /* best effort, volatile, keep last 1 */
}

int main(int argc, char** argv) {
  setvbuf(stdout, NULL, _IOLBF, 0);
  const dds_domainid_t domain = argc > 1 ? (dds_domainid_t)atoi(argv[1]) : 0;
  if (argc > 2) configure_for_keys(domain);
  dds_qos_t* participant_qos = argc > 2 ? qos_with_keys(argv[2]) : NULL;
  dds_entity_t participant = dds_create_participant(domain, participant_qos, NULL);
  dds_delete_qos(participant_qos);
  if (participant < 0) return 4;
  dds_entity_t states = read_state(participant), vectors = read_compensation(participant);
  if (states < 0 || vectors < 0) return 4;

  abbe_v1_ModelState* state = abbe_v1_ModelState__alloc();
  abbe_v1_Compensation* vector = abbe_v1_Compensation__alloc();
  dds_sample_info_t info;
  dds_entity_t waitset = dds_create_waitset(participant);
  dds_waitset_attach(waitset, dds_create_readcondition(states, DDS_ANY_STATE), 0);
  dds_waitset_attach(waitset, dds_create_readcondition(vectors, DDS_ANY_STATE), 0);
  puts("waiting");
  for (;;) {
    dds_waitset_wait(waitset, NULL, 0, DDS_MSECS(50));
    forget_the_dead();
    while (dds_take(states, (void**)&state, &info, 1, 1) > 0) {
      if (info.valid_data) keep(state, states, info.publication_handle);
    }
    while (dds_take(vectors, (void**)&vector, &info, 1, 1) > 0) {
      if (info.valid_data) decide(vector, vectors, info.publication_handle);
    }
  }
}
