#include "mfb_run.hpp"

#include <set>
#include <string>

#include "abbe/calib/mfb/observe/reading_mistakes.hpp"
#include "model_against_truth.hpp"
#include "random_numbers.hpp"

namespace abbe::tests::never_worse {
namespace {

/// With which the 21 errors are determined with the fewest passes.
const std::set<std::string> kFewest{"X1",  "X2",  "X3",  "Y1",   "Y2",   "Y3+",
                                    "Z1+", "Z1-", "Z2+", "DXY1", "DXZ1", "DYZ1"};

void keep_fewest(calib::mfb::Plan& plan) {
  std::erase_if(plan.measurements,
                [](const calib::mfb::Measurement& m) { return !kFewest.contains(m.name); });
}

calib::mfb::Plan random_plan(std::mt19937_64& random) {
  calib::mfb::Plan plan = mfb::paper_plan();
  const std::uint64_t kind = random() % 4;
  if (kind == 0) {
    keep_fewest(plan);
  } else if (kind == 1) {
    plan = mfb::with_pairs(plan);
  }
  plan.noise.probe_m = log_uniform(random, 0.1e-6, 0.6e-6);
  plan.noise.machine_m = log_uniform(random, 0.15e-6, 0.8e-6);
  return plan;
}

/// The bar is a few kelvin from 20 degC, warms up or cools down, and one session in three goes on
/// the next morning at another temperature. Its thermometer, and the temperature at each position,
/// are wrong by errors of the stated uncertainty.
void measure_temperature(MfbRun& run) {
  std::mt19937_64& random = run.random;
  run.probing.expansion = calib::Expansivity{11.5e-6, uniform(random, 0.1e-6, 0.8e-6)};
  run.probing.warmer_K = uniform(random, -2.0, 5.0);
  run.probing.alpha_error_per_K = run.probing.expansion->u_alpha_per_K * normal(random);
  run.plan.noise.u_temperature_K = uniform(random, 0.05, 0.2);
  run.plan.noise.u_common_temperature_K = uniform(random, 0.05, 0.2);
  const double common_K = *run.plan.noise.u_common_temperature_K * normal(random);
  const double slope_K = uniform(random, -0.3, 0.3);
  const std::size_t next_morning = random() % 3 == 0 ? 2 + random() % 8 : 100;
  const double step_K = uniform(random, -3.0, 3.0);
  std::map<std::string, double> measured_K;
  run.probing.warmer_at_K.clear();
  for (calib::mfb::Measurement& m : run.plan.measurements) {
    const std::size_t position = measured_K.size();
    if (!measured_K.contains(m.position)) {
      const double warmer_K =
          slope_K * static_cast<double>(position) + (position >= next_morning ? step_K : 0.0);
      run.probing.warmer_at_K[m.position] = warmer_K;
      measured_K[m.position] = run.probing.warmer_K + warmer_K + common_K +
                               run.plan.noise.u_temperature_K * normal(random);
    }
    m.temperature_K = calib::kReferenceTemperature_K + measured_K.at(m.position);
  }
}

const calib::mfb::Measurement& any_pass(MfbRun& run) {
  return run.plan.measurements[run.random() % run.plan.measurements.size()];
}

/// From a random touch of one pass on, the bar is shifted and turned.
void move_within(MfbRun& run, double shift_m, double turn_rad) {
  const std::string pass = any_pass(run).name;
  const double from = uniform(run.random, 0.2, 0.8);
  const Vector3 shift = shift_m * direction(run.random), turn = turn_rad * direction(run.random);
  run.displace([=](const mfb::TouchMade& t) -> Vector3 {
    return t.measurement.name == pass && t.in_pass > from ? Vector3(shift + turn.cross(t.place_m))
                                                          : Vector3(Vector3::Zero());
  });
}

/// In one position the clamping bends the bar.
void bend(MfbRun& run, double sagitta_m) {
  const std::string position = any_pass(run).position;
  const double angle = uniform(run.random, 0.0, 2.0 * M_PI);
  const Vector3 by(0.0, sagitta_m * std::cos(angle), sagitta_m * std::sin(angle));
  const double length_m = run.probing.pattern.hole_x_m.back();
  run.displace([=](const mfb::TouchMade& t) -> Vector3 {
    const double x = t.place_m.x() / length_m;
    return t.measurement.position == position ? Vector3(4.0 * x * (1.0 - x) * by)
                                              : Vector3(Vector3::Zero());
  });
}

/// After each clamping the bar shifts and turns on, in another direction each time.
void creep(MfbRun& run, double end_m) {
  std::map<std::string, std::pair<Vector3, Vector3>> to;
  const double length_m = run.probing.pattern.hole_x_m.back();
  for (const calib::mfb::Measurement& m : run.plan.measurements) {
    const Vector3 shift = end_m * direction(run.random);
    to.try_emplace(m.name, shift, end_m / length_m * direction(run.random));
  }
  run.displace([to](const mfb::TouchMade& t) -> Vector3 {
    const auto& [shift, turn] = to.at(t.measurement.name);
    return (1.0 - std::exp(-3.0 * t.in_pass)) * (shift + turn.cross(t.place_m));
  });
}

/// The plan with all 17 measurements instead of the fewest.
void measure_all(MfbRun& run) {
  if (run.plan.measurements.size() < 17) {
    const auto noise = run.plan.noise;
    run.plan = mfb::paper_plan();
    run.plan.noise = noise;
    measure_temperature(run);
  }
}

/// The machine warms up: its axes expand and tilt, and its zero point shifts.
void drift(MfbRun& run, double by_m) {
  Eigen::Matrix3d slope;
  for (Eigen::Index i = 0; i < 3; ++i) slope.col(i) = normal3(run.random);
  slope *= by_m / mfb::SmoothError::kTravel_m / 2.0;
  const Vector3 shift = by_m * direction(run.random);
  run.add_error([=](const mfb::TouchMade& t, const Vector3& q) -> Vector3 {
    return (1.0 - std::exp(-1.5 * t.in_session)) * (slope * q + shift);
  });
}

/// Errors of a screw, or of guideways between the nodes.
void waves(MfbRun& run, double amplitude_m, double period_m) {
  Eigen::Matrix3d size;
  Vector3 phase;
  for (Eigen::Index i = 0; i < 3; ++i) {
    size.col(i) = amplitude_m * normal3(run.random);
    phase(i) = uniform(run.random, 0.0, 2.0 * M_PI);
  }
  run.add_error([=](const mfb::TouchMade&, const Vector3& q) -> Vector3 {
    return size * Vector3((2.0 * M_PI / period_m * q + phase).array().sin());
  });
}

void backlash(MfbRun& run, double by_m) {
  run.add_error([=](const mfb::TouchMade& t, const Vector3&) -> Vector3 {
    constexpr double kMoves = 0.1;  // of the feed along the approach
    return 0.5 * by_m * t.outward.unaryExpr([](double n) {
      return n > kMoves ? -1.0 : n < -kMoves ? 1.0 : 0.0;
    });
  });
}

/// The tip triggers later or earlier, by its direction: three lobes about the stylus.
void lobes(MfbRun& run, double by_m) {
  run.displace([=](const mfb::TouchMade& t) -> Vector3 {
    const Vector3 n = t.measurement.axes().transpose() * t.outward;
    return by_m * std::cos(3.0 * std::atan2(n.y(), n.x())) * n;
  });
}

/// One hole of the bar is elsewhere since its calibration.
void move_hole(MfbRun& run, double by_m) {
  const std::size_t hole = 1 + run.random() % (run.probing.pattern.holes() - 2);
  const Vector3 by = by_m * direction(run.random);
  run.displace([=](const mfb::TouchMade& t) -> Vector3 {
    const bool there = t.target.feature == calib::mfb::Feature::Hole && t.target.index == hole;
    return there ? by : Vector3(Vector3::Zero());
  });
}

/// Touches of one pass, `count` in sequence, are off along their normal.
void spoil_touches(MfbRun& run, double by_m, std::size_t count) {
  const std::string pass = any_pass(run).name;
  const double from = uniform(run.random, 0.0, 0.9);
  const double touches = static_cast<double>(run.probing.pattern.count());
  run.displace([=](const mfb::TouchMade& t) -> Vector3 {
    const double after = (t.in_pass - from) * touches;
    const bool off =
        t.measurement.name == pass && after >= 0.0 && after < static_cast<double>(count);
    return off ? Vector3(by_m * (t.measurement.axes().transpose() * t.outward))
               : Vector3(Vector3::Zero());
  });
}

void for_every_reading(MfbRun& run, const std::function<void(Vector3&)>& act) {
  run.spoil = [act](auto&, auto&, auto& touches) {
    for (calib::mfb::PassTouches& pass : touches) {
      for (calib::mfb::Touch& t : pass) act(t.reading_m);
    }
  };
}

/// Changes a coordinate of one hole in bar.toml.
void spoil_bar_file(MfbRun& run, double by_m) {
  const std::size_t hole = 1 + run.random() % (run.probing.pattern.holes() - 2);
  const auto k = static_cast<Eigen::Index>(run.random() % 3);
  run.spoil = [=](calib::mfb::Bar& bar, auto&, auto&) { bar.O_m[hole](k) += by_m; };
}

double over(MfbRun& run, double low, double high) {
  return log_uniform(run.random, low, high);
}
double signed_over(MfbRun& run, double low, double high) {
  const double sign = run.random() % 2 == 0 ? 1.0 : -1.0;
  return sign * over(run, low, high);
}

}  // namespace

void MfbRun::displace(std::function<Vector3(const mfb::TouchMade&)> by) {
  probing.displaced = std::move(by);
}

void MfbRun::add_error(std::function<Vector3(const mfb::TouchMade&, const Vector3& reading_m)> by) {
  probing.more_error_m = std::move(by);
}

std::vector<Fault<MfbRun>> mfb_faults() {
  // What moves or bends a bar in one pass is an error of this measurement; in all, a drift.
  const Names pass{{"measurement", "drift", "outliers"}}, hole{{"hole"}},
      drifts{{"drift", "measurement"}},
      readings{{}, {"the readings fit the plan with", " fit measurement "}};
  return {
      {"none", [](MfbRun&) {}, {}},
      {"bar shifted by 5..50 um within a pass",
       [](MfbRun& r) { move_within(r, over(r, 5e-6, 50e-6), 0.0); }, pass},
      {"bar shifted by 50..500 um within a pass",
       [](MfbRun& r) { move_within(r, over(r, 50e-6, 500e-6), 0.0); }, pass},
      {"bar turned by 20..500 urad within a pass",
       [](MfbRun& r) { move_within(r, 0.0, over(r, 20e-6, 500e-6)); }, pass},
      {"bar bent by 3..30 um in a position",
       [](MfbRun& r) { bend(r, over(r, 3e-6, 30e-6)); },
       {{"measurement"}}},
      {"bar creeps by 5..50 um in each pass", [](MfbRun& r) { creep(r, over(r, 5e-6, 50e-6)); },
       drifts},
      {"steady drift of 5..30 um in each pass",
       [](MfbRun& r) { r.probing.drift_m = over(r, 5e-6, 30e-6); }, drifts},
      {"machine drifts by 10..100 um",
       [](MfbRun& r) {
         measure_all(r);
         drift(r, over(r, 10e-6, 100e-6));
       },
       {}},
      // Without a second measurement of any error nothing contradicts the drift.
      {"the same with the fewest measurements",
       [](MfbRun& r) {
         keep_fewest(r.plan);
         drift(r, over(r, 10e-6, 100e-6));
       },
       {},
       false},
      {"hole moved by 10..200 um since the calibration",
       [](MfbRun& r) { move_hole(r, over(r, 10e-6, 200e-6)); }, hole},
      {"hole coordinate wrong by 10..200 um in the file",
       [](MfbRun& r) { spoil_bar_file(r, signed_over(r, 10e-6, 200e-6)); }, hole},
      {"dirt of 20..100 um under one touch",
       [](MfbRun& r) { spoil_touches(r, over(r, 20e-6, 100e-6), 1); },
       {}},
      {"false trigger of 0.5..5 mm",
       [](MfbRun& r) { spoil_touches(r, over(r, 0.5e-3, 5e-3), 1); },
       {}},
      {"dirt of 20..100 um under five touches",
       [](MfbRun& r) { spoil_touches(r, over(r, 20e-6, 100e-6), 5); },
       {}},
      {"stylus lower by 20..500 um from a touch on",
       [](MfbRun& r) { spoil_touches(r, over(r, 20e-6, 500e-6), 200); }, pass},
      {"probe with lobes of 1..5 um", [](MfbRun& r) { lobes(r, over(r, 1e-6, 5e-6)); }, {}},
      {"form errors of 1..5 um", [](MfbRun& r) { r.probing.form_m = over(r, 1e-6, 5e-6); }, {}},
      {"bar's temperature wrong by 1..8 K",
       [](MfbRun& r) {
         const double by_K = signed_over(r, 1.0, 8.0);
         for (auto& m : r.plan.measurements) *m.temperature_K += by_K;
       },
       {},
       false},
      {"bar's temperature in degrees Fahrenheit",
       [](MfbRun& r) {
         for (auto& m : r.plan.measurements) {
           *m.temperature_K = 273.15 + 32.0 + 1.8 * (*m.temperature_K - 273.15);
         }
       },
       {{"bar-temperature"}, {"check temperature_C"}}},
      {"temperature of one position wrong by 2..10 K",
       [](MfbRun& r) {
         const std::string position = any_pass(r).position;
         const double by_K = signed_over(r, 2.0, 10.0);
         for (auto& m : r.plan.measurements) {
           if (m.position == position) *m.temperature_K += by_K;
         }
       },
       {{"measurement", "bar-temperature-change"}}},
      {"expansion of another material",
       [](MfbRun& r) {
         const double alpha_per_K = r.random() % 2 == 0 ? 23e-6 : 0.5e-6;
         r.spoil = [=](calib::mfb::Bar& bar, auto&, auto&) {
           bar.expansion->alpha_per_K = alpha_per_K;
         };
       },
       {},
       false},
      {"bar longer by 20..200 um/m than its file",
       [](MfbRun& r) {
         const double scale = 1.0 + signed_over(r, 20e-6, 200e-6);
         r.spoil = [=](calib::mfb::Bar& bar, auto&, auto&) {
           for (Vector3& O_m : bar.O_m) O_m *= scale;
         };
       },
       {},
       false},
      {"tool offsets wrong by 2..20 mm",
       [](MfbRun& r) {
         const Vector3 by = over(r, 2e-3, 20e-3) * direction(r.random);
         r.spoil = [=](auto&, calib::mfb::Plan& plan, auto&) {
           for (auto& m : plan.measurements) {
             m.tool_offset_m += by;
             m.origin_m += by;
           }
         };
       },
       {},
       false},
      {"tool offsets of the opposite sign",
       [](MfbRun& r) {
         r.spoil = [=](auto&, calib::mfb::Plan& plan, auto&) {
           for (auto& m : plan.measurements) m.tool_offset_m *= -1.0;
         };
       },
       readings},
      {"axis mirrored",
       [](MfbRun& r) {
         const auto a = static_cast<Eigen::Index>(r.random() % 3);
         for_every_reading(r, [a](Vector3& p) { p(a) = -p(a); });
       },
       readings},
      {"two axes swapped",
       [](MfbRun& r) {
         const auto a = static_cast<Eigen::Index>(r.random() % 3);
         for_every_reading(r, [a](Vector3& p) { std::swap(p(a), p((a + 1) % 3)); });
       },
       readings},
      {"readings in inch", [](MfbRun& r) { for_every_reading(r, [](Vector3& p) { p /= 25.4; }); },
       readings},
      {"two measurements exchanged",
       [](MfbRun& r) {
         const std::size_t one = r.random() % 2, other = 3 + r.random() % 2;
         r.spoil = [=](auto&, auto&, auto& touches) { std::swap(touches[one], touches[other]); };
       },
       readings},
      {"bar turned end for end in one position",
       [](MfbRun& r) {
         const std::string position = any_pass(r).position;
         const double length_m = r.probing.pattern.hole_x_m.back();
         r.spoil = [=](auto&, calib::mfb::Plan& plan, auto&) {
           for (auto& m : plan.measurements) {
             if (m.position == position) {
               m.origin_m += length_m * m.bar_x.normalized();
               m.bar_x *= -1.0;
             }
           }
         };
       },
       {{}, {"lies turned", "the readings fit the plan with", "feature"}}},
      {"backlash of 5..20 um", [](MfbRun& r) { backlash(r, over(r, 5e-6, 20e-6)); }, {}},
      {"five times the noise", [](MfbRun& r) { r.probing.noise = 5.0; }, {{"unknown"}}},
      {"another axis order",
       [](MfbRun& r) {
         r.stated.chain =
             *calib::KinematicChain::parse(r.random() % 2 == 0 ? "[w b Z X Y t]" : "[w b Y Z X t]");
       },
       {}},
      {"screw pitch of 2..20 um", [](MfbRun& r) { waves(r, over(r, 2e-6, 20e-6), 0.01); }, {}},
      {"waves of 2..20 um, 60 mm", [](MfbRun& r) { waves(r, over(r, 2e-6, 20e-6), 0.06); }, {}},
      {"nodes 180 mm apart",
       [](MfbRun& r) {
         const auto nodes = *calib::equidistant_nodes(0.0, 0.55, 0.18);
         r.stated.nodes = {nodes, nodes, nodes};
       },
       {}},
  };
}

MfbRun random_mfb_run(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const double errors = log_uniform(random, 0.5, 8.0);
  MfbRun run{.machine = mfb::SimulatedMachine(random, errors),
             .plan = random_plan(random),
             .probing = {},
             .stated = mfb::paper_machine(),
             .random = {}};
  run.random = random;
  measure_temperature(run);
  return run;
}

Outcome identify_and_compare_mfb(MfbRun run) {
  mfb::ProbedBar probed = mfb::probe(run.machine, run.plan, run.random, run.probing);
  calib::mfb::Plan plan = run.plan;
  if (run.spoil) run.spoil(probed.bar, plan, probed.touches);
  const auto found = calib::mfb::identify(probed.bar, plan, probed.touches, run.stated);
  if (!found) {
    return refused(found.error().text +
                   calib::mfb::corrections_to_plan(probed.bar, plan, probed.touches));
  }
  const auto verdict = calib::mfb::judge(*found, nullptr);
  if (!verdict) return refused(verdict.error().text);

  Outcome outcome;
  outcome.accepted = verdict->accepted;
  outcome.first_reason = verdict->accepted ? "" : verdict->reasons.front();
  outcome.first_cause = verdict->accepted ? "" : verdict->causes.front();
  outcome.sigma0 = found->solution.statistics.sigma0;
  Box box{Vector3::Constant(1e9), Vector3::Constant(-1e9)};
  for (const Vector3& q : found->model.validity().vertices_m()) {
    box = {box.low_m.cwiseMin(q), box.high_m.cwiseMax(q)};
  }
  // The tool of the first pass; the plan may state another one.
  const Vector3 stated_m = plan.measurements.front().tool_offset_m,
                true_m = run.plan.measurements.front().tool_offset_m;
  const auto true_V_m = [&](const Vector3& q) {
    Vector3 V = run.machine.tip_m(q, true_m) - q - true_m;
    if (run.probing.more_error_m) {
      const mfb::TouchMade middle{
          run.plan.measurements.front(), {}, Vector3::Zero(), Vector3::Zero(), 0.5, 0.5};
      V += run.probing.more_error_m(middle, q);
    }
    return V;
  };
  // Datum G2: V is 0 at the reference of the axes, which is 0 for this machine.
  const Vector3 at_reference_m = true_V_m(Vector3::Zero());
  compare_with_truth(outcome, found->model, box, stated_m,
                     [&](const Vector3& q) { return Vector3(true_V_m(q) - at_reference_m); });
  return outcome;
}

}  // namespace abbe::tests::never_worse
