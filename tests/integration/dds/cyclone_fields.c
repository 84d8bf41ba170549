/* Prints every field of the first ErrorModel and of the first ErrorGrid slice 1 that arrive, one a line, so
   that a test can compare them with what was published:   dds_cyclone_fields DOMAIN */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "abbe_v1.h"
#include "dds/dds.h"

static dds_entity_t durable_reader(dds_entity_t participant, const dds_topic_descriptor_t* type,
                                   const char* name) {
  dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return reader;
}

static void print_model(const abbe_v1_ErrorModel* m) {
  printf("model %s %" PRIu64 " %s %s %s %s %s %s %s %.17g %.17g %.17g %s %" PRId64 "\n", m->machine,
         m->sequence_number, m->model_id, m->method, m->estimator, m->gauge, m->chain, m->basis,
         m->squareness, m->tool_offset_m[0], m->tool_offset_m[1], m->tool_offset_m[2], m->recording_sha256,
         m->created_utc_ns);
  for (uint32_t i = 0; i < m->parameters._length; ++i) {
    const abbe_v1_Parameter* p = &m->parameters._buffer[i];
    printf("parameter %s %.17g %.17g %.17g\n", p->name, p->position_m, p->value, p->u);
  }
  for (uint32_t i = 0; i < m->validity._length; ++i) {
    const abbe_v1_AxisRange* r = &m->validity._buffer[i];
    printf("validity %s %.17g %.17g\n", r->axis, r->min_m, r->max_m);
  }
  for (uint32_t i = 0; i < m->validity_hull._length; ++i) {
    const double* p = m->validity_hull._buffer[i].position_m;
    printf("hull %.17g %.17g %.17g\n", p[0], p[1], p[2]);
  }
}

static void print_slice(const abbe_v1_ErrorGrid* g) {
  printf("grid %s %u %u %" PRIu64 " %s %d\n", g->machine, g->slice, g->slices, g->sequence_number, g->model_id,
         g->every_node);
  for (uint32_t i = 0; i < g->nodes._length; ++i) {
    const abbe_v1_GridNode* n = &g->nodes._buffer[i];
    printf("node %.17g %.17g %.17g %.17g %.17g %.17g %.17g %d\n", n->position_m[0], n->position_m[1],
           n->position_m[2], n->error_m[0], n->error_m[1], n->error_m[2], n->cov_m2[5], n->inside);
  }
}

int main(int argc, char** argv) {
  setvbuf(stdout, NULL, _IOLBF, 0);
  dds_entity_t participant = dds_create_participant(argc > 1 ? (dds_domainid_t)atoi(argv[1]) : 0, NULL, NULL);
  if (participant < 0) return 4;
  dds_entity_t models = durable_reader(participant, &abbe_v1_ErrorModel_desc, "abbe/v1/ErrorModel");
  dds_entity_t grids = durable_reader(participant, &abbe_v1_ErrorGrid_desc, "abbe/v1/ErrorGrid");
  if (models < 0 || grids < 0) return 4;
  abbe_v1_ErrorModel* model = abbe_v1_ErrorModel__alloc();
  abbe_v1_ErrorGrid* grid = abbe_v1_ErrorGrid__alloc();
  dds_sample_info_t info;
  int model_printed = 0, slice_printed = 0;
  while (!model_printed || !slice_printed) {
    if (dds_take(models, (void**)&model, &info, 1, 1) > 0 && info.valid_data && !model_printed) {
      print_model(model);
      model_printed = 1;
    }
    if (dds_take(grids, (void**)&grid, &info, 1, 1) > 0 && info.valid_data && grid->slice == 1 &&
        !slice_printed) {
      print_slice(grid);
      slice_printed = 1;
    }
    dds_sleepfor(DDS_MSECS(5));
  }
  puts("end");
  abbe_v1_ErrorModel_free(model, DDS_FREE_ALL);
  abbe_v1_ErrorGrid_free(grid, DDS_FREE_ALL);
  dds_delete(participant);
  return 0;
}
