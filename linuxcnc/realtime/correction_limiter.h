/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef ABBE_LINUXCNC_CORRECTION_LIMITER_H
#define ABBE_LINUXCNC_CORRECTION_LIMITER_H
/* Arithmetic of the realtime component abbe_correction: limits of a correction, and when it is
   applied. Plain C without HAL and without allocation. Lengths in machine units (mm), times in s.
   Every function is for one thread. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* Limits of one axis. A limit that is not finite or not positive is replaced by its default. */
struct abbe_limits {
  double clamp;        /* largest |c|, mm */
  double rate;         /* largest |dc/dt|, mm/s */
  double acceleration; /* largest |d2c/dt2|, mm/s2 */
};

#define ABBE_MOST_JOINTS 9
#define ABBE_DEFAULT_CLAMP 0.2
#define ABBE_DEFAULT_RATE 2.0
#define ABBE_DEFAULT_ACCELERATION 200.0
#define ABBE_DEFAULT_TIMEOUT 0.1

/* Correction of one axis: value in mm, and its change in the last cycle in mm per cycle. */
struct abbe_limiter {
  double value;
  double step;
};

static inline double abbe_or_default(double value, double otherwise) {
  return isfinite(value) && value > 0.0 ? value : otherwise;
}

static inline double abbe_between(double value, double low, double high) {
  return value < low ? low : value > high ? high : value;
}

/* Whether the whole vector may be applied: every component is finite and within the clamp. */
static inline bool abbe_is_finite(const double wanted[], int joints) {
  int i;
  for (i = 0; i < joints; ++i)
    if (!isfinite(wanted[i])) return false;
  return true;
}
static inline bool abbe_is_within(const double wanted[], int joints, double clamp) {
  int i;
  for (i = 0; i < joints; ++i)
    if (!(fabs(wanted[i]) <= clamp)) return false;
  return true;
}

/* Largest step towards a target at the distance d >= 0 from which the axis can still stop there.
   a: largest change of the step from one cycle to the next.
   The steps s, s - a, ..., s - (k - 1) a of k cycles sum up to d:
     s = d / k + a (k - 1) / 2,  k = ceil((sqrt(1 + 8 d / a) - 1) / 2)
   so that the last one is at most a and the value reaches the target without overshoot. */
static inline double abbe_stopping_step(double d, double a) {
  const double k = fmax(1.0, ceil((sqrt(1.0 + 8.0 * d / a) - 1.0) / 2.0));
  return d / k + a * (k - 1.0) / 2.0;
}

/* Largest step of an axis towards a target at the signed distance, 0 if it is behind the axis. */
static inline double abbe_most_towards(double to_go, double change) {
  return to_go > 0.0 ? abbe_stopping_step(to_go, change) : 0.0;
}

/* One cycle of `period` s of all axes towards `target`, whose components are finite and within the
   clamp. The axes move by the same fraction of what is left, so that a vector that fades keeps its
   direction: rate and acceleration are those of the axis with the longest way. An axis that has to
   brake for its own target does so with the whole acceleration. */
static inline void abbe_limiter_move(struct abbe_limiter axes[], const double target[], int joints,
                                     const struct abbe_limits* limits, double period) {
  const double most = abbe_or_default(limits->rate, ABBE_DEFAULT_RATE) * period;
  const double change =
      abbe_or_default(limits->acceleration, ABBE_DEFAULT_ACCELERATION) * period * period;
  double longest = 0.0, largest = 0.0, part;
  int i;

  for (i = 0; i < joints; ++i) longest = fmax(longest, fabs(target[i] - axes[i].value));
  /* Step of the axis with the longest way; the others in proportion. */
  part = longest > 0.0 ? fmin(abbe_stopping_step(longest, change), most) / longest : 0.0;
  for (i = 0; i < joints; ++i)
    largest = fmax(largest, fabs((target[i] - axes[i].value) * part - axes[i].step));

  for (i = 0; i < joints; ++i) {
    struct abbe_limiter* axis = &axes[i];
    const double to_go = target[i] - axis->value;
    const double fraction = largest > change ? change / largest : 1.0;
    const double step = axis->step + (to_go * part - axis->step) * fraction;
    const double low = fmin(-abbe_most_towards(-to_go, change), axis->step + change);
    const double high = fmax(abbe_most_towards(to_go, change), axis->step - change);
    axis->step = abbe_between(abbe_between(step, low, high), -most, most);
    axis->value += axis->step;
  }
}

/* One cycle towards standstill at the present value: the step decreases within the acceleration. */
static inline void abbe_limiter_hold(struct abbe_limiter* axis, const struct abbe_limits* limits,
                                     double period) {
  const double change =
      abbe_or_default(limits->acceleration, ABBE_DEFAULT_ACCELERATION) * period * period;
  axis->step -= abbe_between(axis->step, -change, change);
  axis->value += axis->step;
}

enum abbe_mode {
  ABBE_FADE, /* towards 0 */
  ABBE_HOLD, /* the machine is off: keep the value */
  ABBE_FOLLOW
};

/* Decides whether the correction is applied. Zero-initialized, it is off. */
struct abbe_supervisor {
  uint32_t last_sequence;
  double age;   /* s since the feeder's sequence counter changed */
  bool seen;    /* a sequence number was received since the component was loaded */
  bool enabled; /* the enable pin in the last cycle */
  bool stale;   /* latched until the enable pin is switched on again */
  bool fresh;   /* the feeder answers */
};

struct abbe_inputs {
  bool enable; /* the user's switch */
  bool homed;  /* all joints are homed */
  bool machine_on;
  bool valid; /* the feeder has a correction that may be applied */
  uint32_t sequence;
  double timeout; /* s */
};

/* One cycle. A stale feeder latches `stale`; only a rising edge of `enable` with a fresh feeder
   clears it. While the machine is off the mode is ABBE_HOLD and staleness is still latched. */
static inline enum abbe_mode abbe_supervise(struct abbe_supervisor* s, const struct abbe_inputs* in,
                                            double period) {
  const double timeout = abbe_or_default(in->timeout, ABBE_DEFAULT_TIMEOUT);
  const bool switched_on = in->enable && !s->enabled;
  bool fresh;

  if (!s->seen || in->sequence != s->last_sequence) {
    s->age = s->seen ? 0.0 : 2.0 * timeout; /* the first number may be that of a dead feeder */
    s->seen = true;
    s->last_sequence = in->sequence;
  } else if (s->age <= timeout) {
    s->age += period;
  }
  fresh = s->age <= timeout;
  s->fresh = fresh;

  if (switched_on && fresh) s->stale = false;
  if (in->enable && !fresh) s->stale = true;
  s->enabled = in->enable;

  if (!in->machine_on) return ABBE_HOLD;
  return in->enable && in->homed && in->valid && !s->stale ? ABBE_FOLLOW : ABBE_FADE;
}

/* Differences between applied and wanted vector, mm: below ABBE_REACHED the whole vector is applied
   (0.4 um is what the acceleration limit delays a c that changes smoothly), beyond ABBE_LEFT_BEHIND
   it is not any more. */
#define ABBE_REACHED 0.0005
#define ABBE_LEFT_BEHIND 0.002

/* Why the correction that the user switched on is not applied whole. */
enum abbe_loss {
  ABBE_NOT_LOST,
  ABBE_LOST_STALE,   /* the feeder does not answer */
  ABBE_LOST_REFUSED, /* the feeder has no valid correction */
  ABBE_LOST_NOT_A_NUMBER,
  ABBE_LOST_CLAMP,  /* a component of c is beyond the clamp */
  ABBE_LOST_LIMITED /* c is not reached yet, or changes faster than rate and acceleration allow */
};

/* The correction of all axes. Zero-initialized, it is off. */
struct abbe_corrector {
  struct abbe_limiter axes[ABBE_MOST_JOINTS];
  struct abbe_supervisor supervisor;
  bool active; /* the whole vector is applied, and follows the feeder */
  enum abbe_loss loss;
};

static inline enum abbe_loss abbe_loss_of(const struct abbe_corrector* c,
                                          const struct abbe_inputs* in, const double wanted[],
                                          int joints, double clamp) {
  if (!in->enable || !in->homed || !in->machine_on) return ABBE_NOT_LOST;
  if (c->supervisor.stale) return ABBE_LOST_STALE;
  if (!in->valid) return ABBE_LOST_REFUSED;
  if (!abbe_is_finite(wanted, joints)) return ABBE_LOST_NOT_A_NUMBER;
  if (!abbe_is_within(wanted, joints, clamp)) return ABBE_LOST_CLAMP;
  return c->active ? ABBE_NOT_LOST : ABBE_LOST_LIMITED;
}

/* One cycle. A vector of which one component is not a number or beyond the clamp is not applied in
   part: the whole vector fades to 0. */
static inline void abbe_correct(struct abbe_corrector* c, const struct abbe_inputs* in,
                                const double wanted[], int joints, const struct abbe_limits* limits,
                                double period) {
  static const double nothing[ABBE_MOST_JOINTS] = {0.0};
  const double clamp = abbe_or_default(limits->clamp, ABBE_DEFAULT_CLAMP);
  const enum abbe_mode mode = abbe_supervise(&c->supervisor, in, period);
  const bool follows = mode == ABBE_FOLLOW && abbe_is_within(wanted, joints, clamp);
  double behind = 0.0;
  int i;

  if (mode == ABBE_HOLD) {
    for (i = 0; i < joints; ++i) abbe_limiter_hold(&c->axes[i], limits, period);
  } else {
    abbe_limiter_move(c->axes, follows ? wanted : nothing, joints, limits, period);
  }

  for (i = 0; i < joints; ++i) behind = fmax(behind, fabs(c->axes[i].value - wanted[i]));
  c->active = follows && behind <= (c->active ? ABBE_LEFT_BEHIND : ABBE_REACHED);
  c->loss = abbe_loss_of(c, in, wanted, joints, clamp);
}

#endif
