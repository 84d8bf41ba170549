#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "evemu_run.hpp"
#include "random_numbers.hpp"

namespace abbe::tests::never_worse {
namespace {

namespace evemu = calib::evemu;
using Eigen::Isometry3d;
using Touches = std::vector<evemu::Touch>;

Isometry3d turned_and_shifted(const Vector3& rotation_rad, const Vector3& shift_m) {
  Isometry3d T = Isometry3d::Identity();
  const double angle = rotation_rad.norm();
  if (angle > 0.0) T.linear() = Eigen::AngleAxisd(angle, rotation_rad / angle).toRotationMatrix();
  T.translation() = shift_m;
  return T;
}

int any_position(EvemuRun& run) {
  return 1 + static_cast<int>(run.random() % run.T_machine_array.size());
}

/// The array moves while it is touched in one position.
void move_within(EvemuRun& run, double shift_m, double angle_rad) {
  const int position = any_position(run);
  const double from = uniform(run.random, 0.15, 0.9);
  const Vector3 shift = shift_m * direction(run.random);
  const Vector3 turn = angle_rad * direction(run.random);
  run.moved = [=](const TouchTime& t) {
    return t.position == position && t.in_position > from ? turned_and_shifted(turn, shift)
                                                          : Isometry3d::Identity();
  };
}

/// When the array is turned to the next position, Ball1 is not placed exactly at its previous
/// point.
void move_between(EvemuRun& run) {
  for (Isometry3d& T : run.T_machine_array) {
    const double by_m = log_uniform(run.random, 5e-6, 200e-6);
    T.pretranslate(by_m * direction(run.random));
  }
}

std::size_t any_ball(EvemuRun& run) {
  return run.random() % run.calibrator.balls.size();
}

void swap_balls(EvemuRun& run) {
  const std::size_t i = any_ball(run), j = (i + 1) % run.calibrator.balls.size();
  std::swap(run.calibrator.balls[i].centre_m, run.calibrator.balls[j].centre_m);
}

/// One ball is displaced in one position only: dirt under it, a loose seat.
void displace_ball_once(EvemuRun& run) {
  const int position = any_position(run);
  const Vector3 centre = run.array.balls[1 + run.random() % (run.array.balls.size() - 1)].centre_m;
  const double by_m = log_uniform(run.random, 10e-6, 200e-6);
  const Vector3 by = by_m * direction(run.random);
  const double near_m = 0.02;
  run.bent = [=](const TouchTime& t, const Vector3& place) -> Vector3 {
    return t.position == position && (place - centre).norm() < near_m ? by : Vector3::Zero();
  };
}

/// One touch is displaced outwards along the normal of the surface.
void spoil_touch(EvemuRun& run, double by_m) {
  const std::uint64_t at = run.random();
  run.spoil = [=](Touches& touches) {
    evemu::Touch& bad = touches[at % touches.size()];
    Vector3 mean = Vector3::Zero();
    double count = 0.0;
    for (const evemu::Touch& t : touches) {
      if (t.position == bad.position && t.feature == bad.feature && t.number == bad.number) {
        mean += t.p_m;
        count += 1.0;
      }
    }
    const Vector3 outward = bad.feature == evemu::Feature::Ball ? Vector3(bad.p_m - mean / count)
                            : bad.number == 1                   ? Vector3(Vector3::UnitZ())
                                                                : Vector3(Vector3::UnitY());
    bad.p_m += by_m * outward.normalized();
  };
}

/// In every position the array is bent differently, most at its end.
void bend(EvemuRun& run, double at_the_end_m) {
  std::map<int, Vector3> by;
  for (std::size_t i = 0; i < run.T_machine_array.size(); ++i) {
    by[static_cast<int>(i) + 1] =
        at_the_end_m * Vector3(0.0, 0.3 * normal(run.random), normal(run.random));
  }
  const double end_m = run.array.balls.back().centre_m.x();
  run.bent = [by, end_m](const TouchTime& t, const Vector3& place) -> Vector3 {
    const double x = place.x() / end_m;
    return x * x * by.at(t.position);
  };
}

/// After clamping the array continues to rotate and shift, in every position in another direction.
void creep(EvemuRun& run, double end_m) {
  std::map<int, std::pair<Vector3, Vector3>> to;
  const double length_m = run.array.balls.back().centre_m.x();
  for (std::size_t i = 0; i < run.T_machine_array.size(); ++i) {
    const Vector3 turn = end_m / length_m * direction(run.random);
    to[static_cast<int>(i) + 1] = {turn, 0.5 * end_m * direction(run.random)};
  }
  run.moved = [to](const TouchTime& t) {
    const double share = 1.0 - std::exp(-3.0 * t.in_position);
    const auto& [turn, shift] = to.at(t.position);
    return turned_and_shifted(share * turn, share * shift);
  };
}

/// The machine warms up: it expands, its axes tilt and its zero point drifts.
void drift(EvemuRun& run, double by_m) {
  Eigen::Matrix3d slope;
  for (Eigen::Index i = 0; i < 3; ++i) slope.col(i) = normal3(run.random);
  const double length_m = run.array.balls.back().centre_m.x();
  slope *= by_m / length_m / 2.0;
  const Vector3 shift = by_m * direction(run.random);
  run.drift = [=](const TouchTime& t, const Vector3& q) -> Vector3 {
    return (1.0 - std::exp(-1.5 * t.in_session)) * (slope * q + shift);
  };
}

void touch_position_twice(EvemuRun& run) {
  const std::size_t n = run.T_machine_array.size(), from = run.random() % n, to = (from + 1) % n;
  run.T_machine_array[to] = run.T_machine_array[from];
}

void other_chain(EvemuRun& run) {
  const auto given = run.truth.order;
  auto other = given;
  while (other == given) {
    for (std::size_t i = 2; i > 0; --i) std::swap(other[i], other[run.random() % (i + 1)]);
  }
  std::string text = "[w b";
  for (const sim::Axis a : other)
    text += std::string(" ") + sim::kAxisLetters[static_cast<std::size_t>(a)];
  run.machine.chain = *calib::KinematicChain::parse(text + " t]");
}

/// Errors that no polynomial of order 3 describes: sag under a moving load, periodic error of a
/// screw.
void waves(EvemuRun& run, double amplitude_m, double period_m) {
  for (sim::AxisTruth& axis : run.truth.axes) {
    for (std::size_t m = 0; m < 3; ++m) {
      axis.error[m] = axis.error[m].with_wave(amplitude_m * normal(run.random), period_m);
    }
  }
}

void for_every_touch(EvemuRun& run, const std::function<void(Vector3&)>& act) {
  run.spoil = [act](Touches& touches) {
    for (evemu::Touch& t : touches) act(t.p_m);
  };
}

/// Changes one coordinate of one ball in the calibrator file.
void spoil_the_file(EvemuRun& run, double low_m, double high_m) {
  const std::size_t ball = any_ball(run);
  const auto axis = static_cast<Eigen::Index>(run.random() % 3);
  const double by_m = run.random() % 2 == 0 ? 1.0 : -1.0;
  run.calibrator.balls[ball].centre_m(axis) += by_m * log_uniform(run.random, low_m, high_m);
}

double over(EvemuRun& run, double low, double high) {
  return log_uniform(run.random, low, high);
}
/// The same with a random sign.
double signed_over(EvemuRun& run, double low, double high) {
  const double sign = run.random() % 2 == 0 ? 1.0 : -1.0;
  return sign * over(run, low, high);
}

}  // namespace

std::vector<Fault<EvemuRun>> evemu_faults() {
  // Waves are not polynomials: from ball to ball they look like noise of the balls or slow noise.
  const Names waves_named{{"order", "scatter", "slow-noise"}};
  // An array that moves while a ball is touched increases the form error of this ball.
  const Names moved{{"moved", "form"}}, touch{{"touch"}, {"touch ", "false trigger"}},
      file{{"array-file"}, {"calibrator file"}}, clamping{{"bent", "creep", "moved"}},
      handed{{}, {"mirror", "swapped"}}, position{{}, {"position"}};

  return {
      {"none", [](EvemuRun&) {}, {}},
      {"array shifted by 50..200 um within",
       [](EvemuRun& r) { move_within(r, over(r, 50e-6, 200e-6), 0.0); }, moved},
      {"array shifted by 5..50 um within",
       [](EvemuRun& r) { move_within(r, over(r, 5e-6, 50e-6), 0.0); }, moved},
      {"array turned by 20..500 urad within",
       [](EvemuRun& r) { move_within(r, 0.0, over(r, 20e-6, 500e-6)); }, moved},
      {"array shifted between positions", move_between, {}},
      {"balls swapped in the table", swap_balls, {{}, {"numbered"}}},
      {"ball coordinate wrong by 100..500 um",
       [](EvemuRun& r) { spoil_the_file(r, 100e-6, 500e-6); }, file},
      {"ball coordinate wrong by 20..100 um", [](EvemuRun& r) { spoil_the_file(r, 20e-6, 100e-6); },
       file},
      {"ball elsewhere in one position", displace_ball_once, {{"ball"}}},
      {"dirt of 20..100 um under one touch",
       [](EvemuRun& r) { spoil_touch(r, over(r, 20e-6, 100e-6)); }, touch},
      {"false trigger of 0.5..5 mm", [](EvemuRun& r) { spoil_touch(r, over(r, 0.5e-3, 5e-3)); },
       touch},
      {"array's temperature wrong by 2..10 K",
       [](EvemuRun& r) {
         r.observe.artefact_temperature->temperature_K += signed_over(r, 2.0, 10.0);
       },
       {},
       false},
      {"expansion of another material",
       [](EvemuRun& r) {
         r.calibrator.expansivity->alpha_per_K = r.random() % 2 == 0 ? 23e-6 : 0.5e-6;
       },
       {},
       false},
      {"array bent by 10..50 um per position", [](EvemuRun& r) { bend(r, over(r, 10e-6, 50e-6)); },
       clamping},
      {"array creeps by 10..100 um", [](EvemuRun& r) { creep(r, over(r, 10e-6, 100e-6)); },
       clamping},
      {"tip offset wrong by 2..20 mm",
       [](EvemuRun& r) {
         const double by_m = over(r, 2e-3, 20e-3);
         const Vector3 by = by_m * direction(r.random);
         r.machine.tool_offset_m += by;
         r.stated_tool_offset_m = by;
       },
       {},
       false},
      {"tip diameter wrong by 20..300 um",
       [](EvemuRun& r) { r.calibrator.tip_radius_m += 0.5 * signed_over(r, 20e-6, 300e-6); },
       {{}, {"tip"}}},
      {"tip diameter wrong by 0.5..2 mm",
       [](EvemuRun& r) { r.calibrator.tip_radius_m += 0.5 * signed_over(r, 0.5e-3, 2e-3); },
       {{}, {"tip"}}},
      {"machine drifts by 20..100 um",
       [](EvemuRun& r) { drift(r, over(r, 20e-6, 100e-6)); },
       {{"drift"}}},
      {"axis mirrored",
       [](EvemuRun& r) {
         const auto a = static_cast<Eigen::Index>(r.random() % 3);
         for_every_touch(r, [a](Vector3& p) { p(a) = -p(a); });
       },
       handed},
      {"two axes swapped",
       [](EvemuRun& r) {
         const auto a = static_cast<Eigen::Index>(r.random() % 3);
         for_every_touch(r, [a](Vector3& p) { std::swap(p(a), p((a + 1) % 3)); });
       },
       handed},
      {"touches in mm where m are read",
       [](EvemuRun& r) { for_every_touch(r, [](Vector3& p) { p *= 1000.0; }); },
       {{}, {"lengths in"}}},
      {"one position fewer than planned", [](EvemuRun& r) { r.order.pop_back(); }, position},
      {"one position more than planned", [](EvemuRun& r) { --r.observe.positions; }, position},
      {"one position touched twice", touch_position_twice, position},
      {"backlash of 5..20 um",
       [](EvemuRun& r) {
         for (sim::AxisTruth& axis : r.truth.axes) {
           for (std::size_t m = 0; m < 3; ++m) axis.backlash[m] = over(r, 5e-6, 20e-6);
         }
       },
       {{"backlash"}}},
      {"slow noise of 3..20 um in a position",
       [](EvemuRun& r) { r.slow_noise_m = over(r, 3e-6, 20e-6); },
       {{"slow-noise"}}},
      {"five times the noise", [](EvemuRun& r) { r.sigma_touch_m *= 5.0; }, {}},
      {"another axis order", other_chain, {{"chain-order"}}},
      {"screw pitch of 5..30 um", [](EvemuRun& r) { waves(r, over(r, 5e-6, 30e-6), 0.01); },
       waves_named},
      {"waves of 5..30 um over the volume",
       [](EvemuRun& r) { waves(r, over(r, 5e-6, 30e-6), 0.25); }, waves_named},
  };
}

}  // namespace abbe::tests::never_worse
