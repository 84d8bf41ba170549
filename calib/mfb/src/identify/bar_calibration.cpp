#include "abbe/calib/mfb/identify/bar_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string_view>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/identify/reversal.hpp"
#include "abbe/calib/internal/statistics/student_tail.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"
#include "identify/gauge_line.hpp"
#include "solve/outlying_features.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr double kBeside_m = 1e-3;  // a gauge farther from the bar than this is beside it

/// A measuring machine without limits of travel: only its readings are used.
Result<MfbMachine> machine_without_limits() {
  constexpr double kFar_m = 100.0;
  Result<KinematicChain> chain = KinematicChain::parse("[w b X Y Z t]");
  ABBE_TRY(chain);
  MfbMachine machine{*chain, {}};
  for (auto& axis : machine.nodes) {
    axis.nodes_m = {-kFar_m, -0.5 * kFar_m, 0.5 * kFar_m, kFar_m};
  }
  return machine;
}

/// For each measurement: true if it is a reversed pass.
Result<std::vector<bool>> reversed_passes(const Plan& plan) {
  const Vector3 normal = plan.measurements.front().bar_z.normalized();
  std::vector<bool> reversed;
  std::set<std::string> positions;
  for (const Measurement& m : plan.measurements) {
    constexpr double kParallel = 0.999;
    const double cosine = normal.dot(m.bar_z.normalized());
    if (std::abs(cosine) < kParallel) {
      return failure(ErrorCode::BadInput,
                     message(m.name,
                             ": bar_z is neither that of the first pass (normal) nor its "
                             "opposite (reversed)"));
    }
    if (!positions.insert(m.position).second) {
      return failure(ErrorCode::BadInput,
                     message(m.name, ": position \"", m.position,
                             "\" has two passes: clamp the bar again for every pass"));
    }
    reversed.push_back(cosine < 0.0);
  }
  return reversed;
}

/// Deviations in the axes of a normal pass, at 20 degC.
BarPass deviations_of(const Observations& o, const PassObservation& pass, bool reversed) {
  const double alpha_per_K = o.bar.expansion ? o.bar.expansion->alpha_per_K : 0.0;
  const double growth = 1.0 + alpha_per_K * (pass.temperature_K - kReferenceTemperature_K);
  const Vector3 signs = reversed ? Vector3(1.0, -1.0, -1.0) : Vector3::Ones();
  BarPass deviations_m;
  for (std::size_t i = 0; i < o.bar.O_m.size(); ++i) {
    const Vector3 delta_m = pass.delta_m.segment<3>(3 * static_cast<Eigen::Index>(i));
    deviations_m.emplace_back(signs.cwiseProduct(delta_m / growth));
  }
  return deviations_m;
}

/// Relative standard uncertainty of the length of the bar by its temperature, which is common to
/// all passes.
double u_of_bar_temperature(const Observations& o) {
  if (!o.bar.expansion) {
    return 0.0;
  }
  double from_20_K = 0.0;
  for (const PassObservation& pass : o.passes) {
    from_20_K +=
        (pass.temperature_K - kReferenceTemperature_K) / static_cast<double>(o.passes.size());
  }
  return root_sum_of_squares(o.bar.expansion->u_alpha_per_K * from_20_K,
                             o.bar.expansion->alpha_per_K * o.plan.noise.u_temperature_K);
}

Result<double> u_rotation_rad(const StepGauge& gauge, const Vector3& beside_m) {
  if (gauge.u_rotation_rad || beside_m.norm() <= kBeside_m) {
    return gauge.u_rotation_rad.value_or(0.0);
  }
  return failure(
      ErrorCode::NotApplicable,
      message("step gauge: its line is ", kMmPerM * beside_m.norm(),
              " mm beside that of the bar (bar axes: y ", kMmPerM * beside_m.y(), ", z ",
              kMmPerM * beside_m.z(),
              " mm): measure it on the line of the bar, or state u_rotation, the standard "
              "uncertainty of the rotations of the machine"));
}

Result<void> check_origin(const StepGauge& gauge) {
  const Vector3 read_m = gauge.faces.front().readings_m.front() + gauge.tool_offset_m;
  if ((read_m - gauge.origin_m).norm() <= kBeside_m) {
    return {};
  }
  return failure(ErrorCode::BadInput,
                 message("step gauge: readings and tool offset place the first face at ",
                         mm_text(read_m), ", its origin says ", mm_text(gauge.origin_m),
                         ": the origin is the centre of the tip, reading plus tool offset"));
}

/// Returns an error if two passes have the same readings: one is a copy and would have no scatter.
Result<void> check_distinct(const Plan& plan, std::span<const PassTouches> touches) {
  const auto same = [](const Touch& a, const Touch& b) { return a.reading_m == b.reading_m; };
  for (std::size_t m = 1; m < touches.size(); ++m) {
    for (std::size_t before = 0; before < m; ++before) {
      const PassTouches &a = touches[before], &b = touches[m];
      if (!a.empty() && std::equal(a.begin(), a.end(), b.begin(), b.end(), same)) {
        return failure(ErrorCode::BadInput,
                       message(plan.measurements[m].name, ": its touches are those of ",
                               plan.measurements[before].name, ": measure every pass"));
      }
    }
  }
  return {};
}

/// Contributions to the covariance of x of the points, without that of the repeats.
struct PositioningCovariances {
  Eigen::MatrixXd gauge_m2, abbe_m2, temperature_m2;
};

/// Correlations of the deviations of one pass after end-point levelling. The deviations before
/// levelling are assumed to be independent with equal variances; row i of `relative` contains their
/// weights in the levelled deviation of point i. Points without variance have correlation 0.
Eigen::MatrixXd correlation_of(const Eigen::MatrixXd& relative) {
  const Eigen::MatrixXd covariance = relative * relative.transpose();
  const auto inverse = [](double variance) {
    return variance > 1e-9 ? 1.0 / std::sqrt(variance) : 0.0;
  };
  const Eigen::VectorXd scale = covariance.diagonal().unaryExpr(inverse);
  return scale.asDiagonal() * covariance * scale.asDiagonal();
}

/// Correlations of the levelled deviations: x is relative to point 1; y and z are relative to the
/// line through the first and the last point.
struct LevelledCorrelations {
  Eigen::MatrixXd x, yz;

  explicit LevelledCorrelations(const std::vector<Vector3>& O_m) {
    const Eigen::Index holes = std::ssize(O_m);
    Eigen::MatrixXd from_first = Eigen::MatrixXd::Identity(holes, holes), from_line = from_first;
    for (Eigen::Index i = 0; i < holes; ++i) {
      const double part = O_m[static_cast<std::size_t>(i)].x() / O_m.back().x();
      from_first(i, 0) -= 1.0;
      from_line(i, 0) -= 1.0 - part;
      from_line(i, holes - 1) -= part;
    }
    x = correlation_of(from_first);
    yz = correlation_of(from_line);
  }
};

/// Sets the uncertainties of the calibrated points from all contributions.
void set_uncertainty(BarCalibration& found, const PositioningCovariances& x) {
  const Eigen::Index holes = std::ssize(found.bar.O_m);
  constexpr double kNormal95 = 1.959964;
  const double factor = found.student_t95 / kNormal95;
  const LevelledCorrelations correlation(found.bar.O_m);
  Eigen::MatrixXd& covariance_m2 = found.bar.covariance_m2;
  covariance_m2 = Eigen::MatrixXd::Zero(3 * holes, 3 * holes);

  for (Eigen::Index i = 1; i < holes; ++i) {
    for (Eigen::Index k = 1; k < holes; ++k) {
      const Vector3 u_i_m = factor * found.u_repeats_m[static_cast<std::size_t>(i)];
      const Vector3 u_k_m = factor * found.u_repeats_m[static_cast<std::size_t>(k)];
      const Vector3 r(correlation.x(i, k), correlation.yz(i, k), correlation.yz(i, k));
      covariance_m2.block<3, 3>(3 * i, 3 * k).diagonal() =
          r.cwiseProduct(u_i_m).cwiseProduct(u_k_m);
      covariance_m2(3 * i, 3 * k) += x.gauge_m2(i, k) + x.abbe_m2(i, k) + x.temperature_m2(i, k);
    }
  }

  for (Eigen::Index i = 0; i < holes; ++i) {
    const double repeats_m =
        i == 0 ? 0.0 : factor * found.u_repeats_m[static_cast<std::size_t>(i)].x();
    found.positioning.push_back({repeats_m, std::sqrt(x.gauge_m2(i, i)),
                                 std::sqrt(std::max(0.0, x.abbe_m2(i, i))),
                                 std::sqrt(x.temperature_m2(i, i))});
    found.u_m.emplace_back(covariance_m2.diagonal().segment<3>(3 * i).cwiseSqrt());
  }
}

void set_points(BarCalibration& found, const Bar& nominal, const CalibratedBar& reversal) {
  const std::size_t holes = nominal.O_m.size();
  for (std::size_t i = 0; i < holes; ++i) {
    found.bar.O_m[i] += reversal.error_m[i];
  }
  // These coordinates are 0 by definition of the bar axes; here they still have rounding errors.
  found.bar.O_m.front().setZero();
  found.bar.O_m.back().tail<2>().setZero();
  found.u_repeats_m = reversal.u_mean_m;
  found.machine_m = reversal.machine_m;
  found.degrees_of_freedom = reversal.degrees_of_freedom;
  found.student_t95 = student_quantile(0.05, reversal.degrees_of_freedom);
}

void note_abbe_error(BarCalibration& found, const StepGauge& gauge) {
  const double beside_m = found.gauge_beside_m.norm();
  if (beside_m <= kBeside_m) {
    return;
  }
  double largest_m = 0.0;
  for (const PositioningBudget& x : found.positioning) {
    largest_m = std::max(largest_m, x.abbe_m);
  }
  found.notes.push_back(message("the step gauge lies ", kMmPerM * beside_m,
                                " mm beside the line of the bar: rotations of the machine of ",
                                kUmPerM * gauge.u_rotation_rad.value_or(0.0), " urad add up to ",
                                kUmPerM * largest_m, " um to u(x)"));
}

/// Adds notes about temperatures that the files do not state, with the effect on the result.
void note_temperatures(BarCalibration& found, const StepGauge& gauge, const TouchNoise& noise) {
  const auto without_expansion = [&](std::string_view what) {
    found.notes.push_back(message(what,
                                  " has no thermal expansion: its lengths are not corrected "
                                  "to 20 C, and the uncertainty does not contain this"));
  };
  const auto exact = [&](std::string_view what) {
    found.notes.push_back(
        message("the temperature of the ", what, " has no u_temperature: it counts as exact"));
  };
  if (!found.bar.expansion) {
    without_expansion("the bar");
  } else if (!(noise.u_temperature_K > 0.0)) {
    exact("bar");
  }
  if (!gauge.expansion) {
    without_expansion("the step gauge");
  } else if (!(gauge.u_temperature_K > 0.0)) {
    exact("step gauge");
  }
}

/// Adds a note if E_XX is larger than on any measuring machine. Causes: a wrong temperature, scale
/// or unit.
void note_scale(BarCalibration& found) {
  constexpr double kMost = 50e-6;
  const double length_m = found.bar.O_m.back().x();
  const double scale = found.machine_m.back().x() / length_m;
  if (std::abs(scale) > kMost) {
    found.notes.push_back(message("E_XX of the machine is ", kUmPerM * scale,
                                  " um per m: check the temperature of the step gauge and the "
                                  "expansion of the scales"));
  }
}

void add_notes(BarCalibration& found, const StepGauge& gauge, const Plan& plan) {
  note_abbe_error(found, gauge);
  if (gauge.faces.front().readings_m.size() < 2) {
    found.notes.emplace_back(
        "the step gauge was measured once: its repeatability is not in the uncertainty");
  }
  note_temperatures(found, gauge, plan.noise);
  note_scale(found);
  if (!found.bar.pattern.has_signature()) {
    found.notes.emplace_back(
        "the bar has no shifted holes: a bar that lies turned is not recognised");
  }
}

/// The passes along the bar, and the line of the bar on the machine.
struct MeasuredPasses {
  Observations observed;
  std::vector<bool> reversed;  ///< for each measurement
  BarLine line;
};

Result<MeasuredPasses> measured_passes(const Bar& nominal, const Plan& plan,
                                       std::span<const PassTouches> touches,
                                       const ObserveLimits& limits) {
  const Result<MfbMachine> machine = machine_without_limits();
  ABBE_TRY(machine);
  Result<Observations> o = observe(nominal, plan, touches, *machine, limits);
  ABBE_TRY(o);
  ABBE_TRY(check_distinct(plan, touches));
  Result<BarLine> line = line_of_bar(*o);
  ABBE_TRY(line);
  Result<std::vector<bool>> reversed = reversed_passes(plan);
  ABBE_TRY(reversed);
  return MeasuredPasses{*std::move(o), *std::move(reversed), *std::move(line)};
}

Result<CalibratedBar> reversal_of(const MeasuredPasses& passes, const Positioning& x) {
  ReversalRuns runs;
  for (const PassObservation& pass : passes.observed.passes) {
    const bool reversed = passes.reversed[pass.measurement];
    (reversed ? runs.reversed : runs.normal)
        .push_back(deviations_of(passes.observed, pass, reversed));
  }
  runs.machine_x_m.assign(x.E_m.begin(), x.E_m.end());
  return calibrate_by_reversal(runs);
}

PositioningCovariances covariances_of(const MeasuredPasses& passes, const Positioning& x,
                                      double beside_m, double u_rotation) {
  const std::vector<double>& along_m = passes.line.coordinate_m;
  Eigen::VectorXd distance_m(std::ssize(along_m));
  for (Eigen::Index i = 0; i < distance_m.size(); ++i) {
    distance_m(i) = along_m[static_cast<std::size_t>(i)] - along_m.front();
  }
  const double u_length = u_of_bar_temperature(passes.observed);
  return {x.covariance_m2, abbe_covariance_m2(beside_m, u_rotation, along_m),
          u_length * u_length * distance_m * distance_m.transpose()};
}

/// Distance of the line of the gauge from that of the bar in bar axes: the larger of the values at
/// both ends.
Vector3 beside_bar_m(const GaugeLine& gauge, const BarLine& bar) {
  const Vector3 direction = bar.axes.transpose() * gauge.direction;
  Vector3 largest_m = Vector3::Zero();
  for (const double from_middle : {-0.5, 0.5}) {
    const Vector3 place_m(from_middle * bar.length_m, 0.0, 0.0);
    const Vector3 off_m = bar.axes.transpose() * (gauge.middle_m - bar.middle_m) - place_m;
    Vector3 beside_m = off_m - direction * (off_m.x() / direction.x());
    beside_m.x() = 0.0;
    if (beside_m.norm() > largest_m.norm()) {
      largest_m = beside_m;
    }
  }
  return largest_m;
}

/// The gauge as it was measured along the bar.
struct MeasuredGauge {
  Positioning x;
  Vector3 beside_bar_m = Vector3::Zero();
};

Result<MeasuredGauge> measured_gauge(const StepGauge& gauge, const BarLine& bar) {
  const Result<GaugeLine> line = line_of_gauge(gauge);
  ABBE_TRY(line);
  return check_alignment(gauge, *line, bar)
      .and_then([&] { return positioning_by_gauge(gauge, *line, bar); })
      .and_then([&](Positioning x) {
        return check_origin(gauge).map([&] {
          return MeasuredGauge{std::move(x), beside_bar_m(*line, bar)};
        });
      });
}

}  // namespace

Result<BarCalibration> calibrate_bar(const Bar& nominal, const Plan& plan,
                                     std::span<const PassTouches> touches, const StepGauge& gauge,
                                     const ObserveLimits& limits) {
  const Result<MeasuredPasses> passes = measured_passes(nominal, plan, touches, limits);
  ABBE_TRY(passes);
  const Result<MeasuredGauge> measured = measured_gauge(gauge, passes->line);
  ABBE_TRY(measured);

  BarCalibration found{.bar = nominal};
  found.direction = passes->line.axes.col(0);
  found.gauge_beside_m = measured->beside_bar_m;
  const Result<double> u_rotation = u_rotation_rad(gauge, found.gauge_beside_m);
  ABBE_TRY(u_rotation);
  const Result<CalibratedBar> reversal = reversal_of(*passes, measured->x);
  ABBE_TRY(reversal);

  set_points(found, nominal, *reversal);
  set_uncertainty(found,
                  covariances_of(*passes, measured->x, found.gauge_beside_m.norm(), *u_rotation));
  found.notes = outlying_features(nominal, plan, touches);
  const auto append = [&](const std::vector<std::string>& notes) {
    found.notes.insert(found.notes.end(), notes.begin(), notes.end());
  };
  append(notes_of_line(passes->observed, passes->line, most_angle_rad(gauge, passes->line)));
  append(measured->x.notes);
  add_notes(found, gauge, plan);
  return found;
}

Result<Vector3> direction_of_bar(const Bar& nominal, const Plan& plan,
                                 std::span<const PassTouches> touches,
                                 const ObserveLimits& limits) {
  return measured_passes(nominal, plan, touches, limits).map([](const MeasuredPasses& passes) {
    return Vector3(passes.line.axes.col(0));
  });
}

Result<void> check_pass(const Bar& nominal, const Plan& plan, std::size_t measurement,
                        const PassTouches& touches, const ObserveLimits& limits) {
  const Result<MfbMachine> machine = machine_without_limits();
  ABBE_TRY(machine);
  Plan alone = plan;
  alone.measurements = {plan.measurements[measurement]};
  const Result<Observations> observed =
      observe(nominal, alone, std::span(&touches, 1), *machine, limits);
  ABBE_TRY(observed);
  return {};
}

}  // namespace abbe::calib::mfb
