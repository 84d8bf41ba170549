/* How to apply abbe's correction, with Cyclone DDS in C and the types idlc makes of abbe_v1.idl:
     cyclone_subscriber DOMAIN
   prints for every Compensation whether it may be applied. One thread. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "abbe_v1.h"
#include "dds/dds.h"

/* How often we look, so how long a vector may have waited for us. */
static const dds_duration_t poll_period = DDS_MSECS(5);

/* The rule of abbe_v1.idl. answered_for: a writer of ModelState keeps its lease. */
static const char* why_not(const abbe_v1_Compensation* c, const abbe_v1_ModelState* state,
                           bool answered_for) {
  if (!answered_for) return "nobody answers for the model";
  if (state->state != abbe_v1_MODEL_ACTIVE || c->state != abbe_v1_MODEL_ACTIVE)
    return "the model is not ACTIVE";
  if (strcmp(c->model_id, state->model_id) != 0) return "the vector is of another model";
  if (!c->inside) return "outside the volume the data covered";
  if (!c->tool_ok) return "the model does not hold for this tool";
  if (c->age_ns + poll_period > c->validity_ns) return "too old";
  return NULL;
}

static void decide(const abbe_v1_Compensation* c, const abbe_v1_ModelState* state, bool answered_for) {
  const char* reason = why_not(c, state, answered_for);
  if (reason != NULL) {
    printf("do not apply: %s\n", reason);
  } else {
    printf("apply V = %.3f %.3f %.3f um\n", c->vector_m[0] * 1e6, c->vector_m[1] * 1e6, c->vector_m[2] * 1e6);
  }
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
  dds_entity_t participant = dds_create_participant(argc > 1 ? (dds_domainid_t)atoi(argv[1]) : 0, NULL, NULL);
  if (participant < 0) return 4;
  dds_entity_t states = read_state(participant), vectors = read_compensation(participant);
  if (states < 0 || vectors < 0) return 4;

  abbe_v1_ModelState* state = abbe_v1_ModelState__alloc();
  abbe_v1_Compensation* vector = abbe_v1_Compensation__alloc();
  dds_sample_info_t info;
  bool answered_for = false;
  puts("waiting");
  for (;;) {
    dds_liveliness_changed_status_t liveliness;
    dds_get_liveliness_changed_status(states, &liveliness);
    if (answered_for != (liveliness.alive_count > 0)) {
      answered_for = liveliness.alive_count > 0;
      printf("answered_for %d\n", answered_for);
    }
    while (dds_take(states, (void**)&state, &info, 1, 1) > 0) {
      if (info.valid_data) printf("state %d %s\n", (int)state->state, state->reason);
    }
    while (dds_take(vectors, (void**)&vector, &info, 1, 1) > 0) {
      if (info.valid_data) decide(vector, state, answered_for);
    }
    dds_sleepfor(poll_period);
  }
}
