/* SPDX-License-Identifier: GPL-2.0-or-later */
/* abbe_correction: adds a correction c to the motor commands of LinuxCNC and subtracts it from the
   feedback, so that the control sees neither a following error nor another position.

     loadrt abbe_correction joints=3
     addf abbe-correction.feedback servo-thread     before motion-controller
     addf abbe-correction.command  servo-thread     after it

   Pins: README.md. Limits and the decision whether c is applied: correction_limiter.h. */
#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include "correction_limiter.h"

#define MOST_JOINTS 9

MODULE_AUTHOR("abbe");
MODULE_DESCRIPTION("Adds a limited correction to motor commands");
MODULE_LICENSE("GPL");
static int joints = 3;
RTAPI_MP_INT(joints, "number of joints, 1 to 9");

struct joint_pins {
  hal_float_t *command, *drive, *encoder, *feedback, *wanted, *applied;
};

struct component {
  struct joint_pins pins[MOST_JOINTS];
  hal_bit_t *enable, *homed, *machine_on, *valid, *active, *stale, *not_a_number;
  hal_u32_t *begin, *end;
  hal_float_t clamp, rate, acceleration, timeout;
  struct abbe_limiter axes[MOST_JOINTS];
  double wanted[MOST_JOINTS];
  struct abbe_supervisor supervisor;
  bool valid_read;
  uint32_t sequence;
};

static int id;
static struct component* self;

/* Reads the feeder's values if it is not writing: it writes `begin`, the values, then `end`. A torn
   read keeps the values and the sequence number of the last complete one. */
static void read_feeder(struct component* c) {
  double values[MOST_JOINTS];
  bool valid;
  int i;
  const uint32_t end = __atomic_load_n(c->end, __ATOMIC_ACQUIRE);

  for (i = 0; i < joints; ++i) values[i] = *c->pins[i].wanted;
  valid = *c->valid;
  __atomic_thread_fence(__ATOMIC_ACQUIRE);
  if (__atomic_load_n(c->begin, __ATOMIC_RELAXED) != end) return;

  for (i = 0; i < joints; ++i) c->wanted[i] = values[i];
  c->valid_read = valid;
  c->sequence = end;
}

static void feedback(void* argument, long period) {
  struct component* c = argument;
  int i;
  (void)period;
  for (i = 0; i < joints; ++i) *c->pins[i].feedback = *c->pins[i].encoder - *c->pins[i].applied;
}

static void command(void* argument, long period_ns) {
  struct component* c = argument;
  const double period = (double)period_ns * 1e-9;
  const struct abbe_limits limits = {c->clamp, c->rate, c->acceleration};
  struct abbe_inputs in;
  enum abbe_mode mode;
  bool not_a_number = false;
  int i;

  read_feeder(c);
  in.enable = *c->enable;
  in.homed = *c->homed;
  in.machine_on = *c->machine_on;
  in.valid = c->valid_read;
  in.sequence = c->sequence;
  in.timeout = c->timeout;
  mode = abbe_supervise(&c->supervisor, &in, period);

  for (i = 0; i < joints; ++i) {
    const double target = mode == ABBE_FOLLOW ? c->wanted[i] : 0.0;
    if (!isfinite(target)) not_a_number = true;
    if (mode == ABBE_HOLD) {
      abbe_limiter_hold(&c->axes[i], &limits, period);
    } else {
      abbe_limiter_move(&c->axes[i], target, &limits, period);
    }
    *c->pins[i].applied = c->axes[i].value;
    *c->pins[i].drive = *c->pins[i].command + c->axes[i].value;
  }
  *c->active = mode == ABBE_FOLLOW;
  *c->stale = c->supervisor.stale;
  *c->not_a_number = not_a_number;
}

static int export_joint(struct joint_pins* p, int i) {
  int r = hal_pin_float_newf(HAL_IN, &p->command, id, "abbe-correction.%d.command", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->drive, id, "abbe-correction.%d.drive", i);
  r |= hal_pin_float_newf(HAL_IN, &p->encoder, id, "abbe-correction.%d.encoder", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->feedback, id, "abbe-correction.%d.feedback", i);
  r |= hal_pin_float_newf(HAL_IN, &p->wanted, id, "abbe-correction.%d.wanted", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->applied, id, "abbe-correction.%d.applied", i);
  return r;
}

static int export_common(struct component* c) {
  int r = hal_pin_bit_newf(HAL_IN, &c->enable, id, "abbe-correction.enable");
  r |= hal_pin_bit_newf(HAL_IN, &c->homed, id, "abbe-correction.homed");
  r |= hal_pin_bit_newf(HAL_IN, &c->machine_on, id, "abbe-correction.machine-on");
  r |= hal_pin_bit_newf(HAL_IN, &c->valid, id, "abbe-correction.valid");
  r |= hal_pin_u32_newf(HAL_IN, &c->begin, id, "abbe-correction.sequence-begin");
  r |= hal_pin_u32_newf(HAL_IN, &c->end, id, "abbe-correction.sequence-end");
  r |= hal_pin_bit_newf(HAL_OUT, &c->active, id, "abbe-correction.active");
  r |= hal_pin_bit_newf(HAL_OUT, &c->stale, id, "abbe-correction.stale");
  r |= hal_pin_bit_newf(HAL_OUT, &c->not_a_number, id, "abbe-correction.not-a-number");
  r |= hal_param_float_newf(HAL_RW, &c->clamp, id, "abbe-correction.clamp");
  r |= hal_param_float_newf(HAL_RW, &c->rate, id, "abbe-correction.rate");
  r |= hal_param_float_newf(HAL_RW, &c->acceleration, id, "abbe-correction.acceleration");
  r |= hal_param_float_newf(HAL_RW, &c->timeout, id, "abbe-correction.timeout");
  c->clamp = ABBE_DEFAULT_CLAMP;
  c->rate = ABBE_DEFAULT_RATE;
  c->acceleration = ABBE_DEFAULT_ACCELERATION;
  c->timeout = ABBE_DEFAULT_TIMEOUT;
  return r;
}

int rtapi_app_main(void) {
  int i, r = 0;
  if (joints < 1 || joints > MOST_JOINTS) {
    rtapi_print_msg(RTAPI_MSG_ERR, "abbe_correction: joints=%d; it must be 1 to 9\n", joints);
    return -EINVAL;
  }
  id = hal_init("abbe_correction");
  if (id < 0) return id;

  self = hal_malloc(sizeof *self);
  if (self == 0) {
    hal_exit(id);
    return -ENOMEM;
  }
  __builtin_memset(self, 0, sizeof *self);

  for (i = 0; i < joints; ++i) r |= export_joint(&self->pins[i], i);
  r |= export_common(self);
  r |= hal_export_funct("abbe-correction.feedback", feedback, self, 1, 0, id);
  r |= hal_export_funct("abbe-correction.command", command, self, 1, 0, id);
  if (r != 0) {
    hal_exit(id);
    return -EINVAL;
  }
  return hal_ready(id);
}

void rtapi_app_exit(void) {
  hal_exit(id);
}
