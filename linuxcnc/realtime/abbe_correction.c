/* SPDX-License-Identifier: GPL-2.0-or-later */
/* abbe_correction: adds a correction c to the motor commands of LinuxCNC and subtracts it from the
   feedback, so that the control sees neither a following error nor another position.

     loadrt abbe_correction joints=3
     addf abbe-correction.feedback servo-thread     before motion-controller
     addf abbe-correction.command  servo-thread     after it

   c comes from abbe-linuxcnc-feeder through shared memory (hand_over.h), so that the pins outlive a
   feeder that was killed. Pins: README.md. Limits and the decision whether c is applied:
   correction_limiter.h. */
#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>
#include <sys/shm.h>

#include "correction_limiter.h"
#include "hand_over.h"

MODULE_AUTHOR("abbe");
MODULE_DESCRIPTION("Adds a limited correction to motor commands");
MODULE_LICENSE("GPL");
static int joints = 3;
RTAPI_MP_INT(joints, "number of joints, 1 to 9");
static int key = ABBE_HAND_OVER_KEY;
RTAPI_MP_INT(key, "key of the shared memory, --key of the feeder");

/* What happens to the program when the correction is lost: parameter on-loss. */
enum { ON_LOSS_NOTHING, ON_LOSS_INHIBIT, ON_LOSS_PAUSE };

/* A loss that is shorter is not shown on the screen, s. c is reached within this time. */
#define SHOWN_LOSS 0.1

struct joint_pins {
  hal_float_t *command, *drive, *encoder, *feedback, *position, *wanted, *applied;
};

/* The pins of the tool, and where they point while they are not linked: HAL changes the pointer. */
struct tool_pins {
  hal_float_t* offset[3];
  hal_s32_t* number;
  hal_float_t* unlinked_offset[3];
  hal_s32_t* unlinked_number;
};

struct component {
  struct joint_pins pins[ABBE_MOST_JOINTS];
  struct tool_pins tool;
  hal_bit_t *enable, *homed, *machine_on, *valid, *active, *stale, *limited, *not_a_number, *lost,
      *feed_inhibit, *pause;
  hal_float_t clamp, rate, acceleration, timeout;
  hal_u32_t on_loss;
  hal_bit_t message;

  struct abbe_corrector corrector;
  struct abbe_tool_watch tool_watch;
  struct abbe_control control;
  struct abbe_wanted wanted;
  uint32_t wanted_number;
  double wanted_of_joint[ABBE_MOST_JOINTS];
  double lost_for; /* s */
  bool shown;
};

static int id, memory = -1;
static struct component* self;
static struct abbe_hand_over* hand_over;

static void feedback(void* argument, long period) {
  struct component* c = argument;
  int i;
  (void)period;
  for (i = 0; i < joints; ++i) *c->pins[i].feedback = *c->pins[i].encoder - *c->pins[i].applied;
}

static bool tool_is_linked(const struct tool_pins* tool) {
  int i;
  for (i = 0; i < 3; ++i)
    if (tool->offset[i] == tool->unlinked_offset[i]) return false;
  return tool->number != tool->unlinked_number;
}

/* Gives the feeder the positions of this cycle. */
static void write_control(struct component* c) {
  struct abbe_control* control = &c->control;
  int i;
  ++control->cycle;
  for (i = 0; i < joints && i < ABBE_CORRECTED_JOINTS; ++i)
    control->position[i] = *c->pins[i].position;
  for (i = 0; i < 3; ++i) control->tool_offset[i] = *c->tool.offset[i];
  control->tool_number = *c->tool.number;
  control->tool = abbe_watch_tool(&c->tool_watch, tool_is_linked(&c->tool), control->tool_number,
                                  control->tool_offset);
  control->homed = *c->homed;
  abbe_write(&hand_over->control_sequence, &hand_over->control, control, sizeof *control);
}

/* Takes the values of the feeder if it is not writing; else those of the cycle before are kept. */
static void read_wanted(struct component* c) {
  struct abbe_wanted wanted;
  int i;
  if (!abbe_read(&hand_over->wanted_sequence, &wanted, &hand_over->wanted, sizeof wanted,
                 &c->wanted_number))
    return;
  c->wanted = wanted;
  c->wanted.reason[ABBE_REASON_SIZE - 1] = 0;
  for (i = 0; i < joints && i < ABBE_CORRECTED_JOINTS; ++i)
    c->wanted_of_joint[i] = wanted.correction[i];
}

static const char* why_lost(const struct component* c) {
  switch (c->corrector.loss) {
    case ABBE_LOST_STALE:
      return "the feeder did not answer; when it runs, switch abbe-correction.enable off and on";
    case ABBE_LOST_REFUSED:
      return c->wanted.reason;
    case ABBE_LOST_NOT_A_NUMBER:
      return "a component of the correction is not a number";
    case ABBE_LOST_CLAMP:
      return "a component of the correction is beyond abbe-correction.clamp";
    case ABBE_LOST_LIMITED:
      return "the correction changes faster than abbe-correction.rate; reduce the feed";
    default:
      return "";
  }
}

/* Shows on the screen of the operator that the correction is lost, once for each loss: motion passes
   error messages to the user interface. */
static void show_loss(struct component* c, double period) {
  static const char* const consequence[] = {"the program continues without it",
                                            "the feed is inhibited", "the program is paused"};
  c->lost_for = c->corrector.loss == ABBE_NOT_LOST ? 0.0 : c->lost_for + period;
  if (c->corrector.loss == ABBE_NOT_LOST) c->shown = false;
  if (!c->message || c->shown || c->lost_for < SHOWN_LOSS) return;
  c->shown = true;
  rtapi_print_msg(RTAPI_MSG_ERR, "abbe: correction lost, %s: %s\n",
                  consequence[c->on_loss <= ON_LOSS_PAUSE ? c->on_loss : ON_LOSS_INHIBIT],
                  why_lost(c));
}

static void write_state(struct component* c) {
  const struct abbe_corrector* corrector = &c->corrector;
  const enum abbe_loss loss = corrector->loss;
  const bool lost = loss != ABBE_NOT_LOST;
  *c->valid = corrector->supervisor.fresh && c->wanted.valid;
  *c->active = corrector->active;
  *c->stale = corrector->supervisor.stale;
  *c->limited = loss == ABBE_LOST_CLAMP || loss == ABBE_LOST_LIMITED;
  *c->not_a_number = loss == ABBE_LOST_NOT_A_NUMBER;
  *c->lost = lost;
  *c->pause = lost && c->on_loss == ON_LOSS_PAUSE;
  /* A value that has no meaning inhibits, too. */
  *c->feed_inhibit = lost && c->on_loss != ON_LOSS_NOTHING && c->on_loss != ON_LOSS_PAUSE;
}

static void command(void* argument, long period_ns) {
  struct component* c = argument;
  const double period = (double)period_ns * 1e-9;
  const struct abbe_limits limits = {c->clamp, c->rate, c->acceleration};
  struct abbe_inputs in;
  int i;

  write_control(c);
  read_wanted(c);
  in.enable = *c->enable;
  in.homed = *c->homed;
  in.machine_on = *c->machine_on;
  in.valid = c->wanted.valid;
  in.sequence = c->wanted_number;
  in.timeout = c->timeout;
  abbe_correct(&c->corrector, &in, c->wanted_of_joint, joints, &limits, period);

  for (i = 0; i < joints; ++i) {
    *c->pins[i].wanted = c->wanted_of_joint[i];
    *c->pins[i].applied = c->corrector.axes[i].value;
    *c->pins[i].drive = *c->pins[i].command + c->corrector.axes[i].value;
  }
  write_state(c);
  show_loss(c, period);
}

static int export_joint(struct joint_pins* p, int i) {
  int r = hal_pin_float_newf(HAL_IN, &p->command, id, "abbe-correction.%d.command", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->drive, id, "abbe-correction.%d.drive", i);
  r |= hal_pin_float_newf(HAL_IN, &p->encoder, id, "abbe-correction.%d.encoder", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->feedback, id, "abbe-correction.%d.feedback", i);
  r |= hal_pin_float_newf(HAL_IN, &p->position, id, "abbe-correction.%d.position", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->wanted, id, "abbe-correction.%d.wanted", i);
  r |= hal_pin_float_newf(HAL_OUT, &p->applied, id, "abbe-correction.%d.applied", i);
  return r;
}

static int export_tool(struct tool_pins* tool) {
  static const char axes[] = "xyz";
  int i, r = 0;
  for (i = 0; i < 3; ++i) {
    r |=
        hal_pin_float_newf(HAL_IN, &tool->offset[i], id, "abbe-correction.tool-offset.%c", axes[i]);
    tool->unlinked_offset[i] = tool->offset[i];
  }
  r |= hal_pin_s32_newf(HAL_IN, &tool->number, id, "abbe-correction.tool-number");
  tool->unlinked_number = tool->number;
  return r;
}

static int export_switches(struct component* c) {
  int r = hal_pin_bit_newf(HAL_IN, &c->enable, id, "abbe-correction.enable");
  r |= hal_pin_bit_newf(HAL_IN, &c->homed, id, "abbe-correction.homed");
  r |= hal_pin_bit_newf(HAL_IN, &c->machine_on, id, "abbe-correction.machine-on");
  r |= hal_pin_bit_newf(HAL_OUT, &c->valid, id, "abbe-correction.valid");
  r |= hal_pin_bit_newf(HAL_OUT, &c->active, id, "abbe-correction.active");
  r |= hal_pin_bit_newf(HAL_OUT, &c->stale, id, "abbe-correction.stale");
  r |= hal_pin_bit_newf(HAL_OUT, &c->limited, id, "abbe-correction.limited");
  r |= hal_pin_bit_newf(HAL_OUT, &c->not_a_number, id, "abbe-correction.not-a-number");
  r |= hal_pin_bit_newf(HAL_OUT, &c->lost, id, "abbe-correction.lost");
  r |= hal_pin_bit_newf(HAL_OUT, &c->feed_inhibit, id, "abbe-correction.feed-inhibit");
  r |= hal_pin_bit_newf(HAL_OUT, &c->pause, id, "abbe-correction.pause");
  return r;
}

static int export_parameters(struct component* c) {
  int r = hal_param_float_newf(HAL_RW, &c->clamp, id, "abbe-correction.clamp");
  r |= hal_param_float_newf(HAL_RW, &c->rate, id, "abbe-correction.rate");
  r |= hal_param_float_newf(HAL_RW, &c->acceleration, id, "abbe-correction.acceleration");
  r |= hal_param_float_newf(HAL_RW, &c->timeout, id, "abbe-correction.timeout");
  r |= hal_param_u32_newf(HAL_RW, &c->on_loss, id, "abbe-correction.on-loss");
  r |= hal_param_bit_newf(HAL_RW, &c->message, id, "abbe-correction.message");
  c->clamp = ABBE_DEFAULT_CLAMP;
  c->rate = ABBE_DEFAULT_RATE;
  c->acceleration = ABBE_DEFAULT_ACCELERATION;
  c->timeout = ABBE_DEFAULT_TIMEOUT;
  c->on_loss = ON_LOSS_INHIBIT;
  c->message = 1;
  return r;
}

static int export_all(void) {
  int i, r = 0;
  for (i = 0; i < joints; ++i) r |= export_joint(&self->pins[i], i);
  r |= export_tool(&self->tool);
  r |= export_switches(self);
  r |= export_parameters(self);
  r |= hal_export_funct("abbe-correction.feedback", feedback, self, 1, 0, id);
  r |= hal_export_funct("abbe-correction.command", command, self, 1, 0, id);
  return r;
}

/* Empties the memory: a feeder of before loses it, because its process id is no longer there. */
static int open_hand_over(void) {
  void* mapped = 0;
  memory = rtapi_shmem_new(key, id, ABBE_HAND_OVER_SIZE);
  if (memory < 0) return memory;
  if (rtapi_shmem_getptr(memory, &mapped) < 0) return -EINVAL;
  hand_over = mapped;
  memset(hand_over, 0, sizeof *hand_over);
  __atomic_store_n(&hand_over->version, ABBE_HAND_OVER_VERSION, __ATOMIC_RELEASE);
  return 0;
}

/* RTAPI keeps memory to which a feeder is still attached, with its key: the next LinuxCNC may run as
   another user. */
static void close_hand_over(void) {
  int left;
  if (hand_over != 0) __atomic_store_n(&hand_over->closed, 1u, __ATOMIC_RELEASE);
  if (memory < 0) return;
  rtapi_shmem_delete(memory, id);
  left = shmget(key, 0, 0);
  if (left >= 0) shmctl(left, IPC_RMID, 0);
}

int rtapi_app_main(void) {
  if (joints < 1 || joints > ABBE_MOST_JOINTS) {
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

  if (open_hand_over() != 0 || export_all() != 0) {
    close_hand_over();
    hal_exit(id);
    return -EINVAL;
  }
  return hal_ready(id);
}

void rtapi_app_exit(void) {
  close_hand_over();
  hal_exit(id);
}
