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

/* Target within the clamp. A target that is not finite is 0. */
static inline double abbe_clamped_target(double target, double clamp) {
  return isfinite(target) ? abbe_between(target, -clamp, clamp) : 0.0;
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

/* One cycle of `period` s towards `target`. */
static inline void abbe_limiter_move(struct abbe_limiter* axis, double target,
                                     const struct abbe_limits* limits, double period) {
  const double clamp = abbe_or_default(limits->clamp, ABBE_DEFAULT_CLAMP);
  const double most = abbe_or_default(limits->rate, ABBE_DEFAULT_RATE) * period;
  const double change =
      abbe_or_default(limits->acceleration, ABBE_DEFAULT_ACCELERATION) * period * period;
  const double to_go = abbe_clamped_target(target, clamp) - axis->value;

  double step = copysign(fmin(abbe_stopping_step(fabs(to_go), change), most), to_go);
  step = abbe_between(step, axis->step - change, axis->step + change);
  axis->step = abbe_between(step, -most, most);
  axis->value += axis->step;
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

  if (switched_on && fresh) s->stale = false;
  if (in->enable && !fresh) s->stale = true;
  s->enabled = in->enable;

  if (!in->machine_on) return ABBE_HOLD;
  return in->enable && in->homed && in->valid && !s->stale ? ABBE_FOLLOW : ABBE_FADE;
}

#endif
