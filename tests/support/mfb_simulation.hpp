#pragma once
/// A machine with 21 known errors that probes a Multi-Feature Bar, for tests: exact transforms of
/// [Viprey 2016] eq. 8 with exact rotations, written independently of the error model of calib. The
/// errors are smooth functions in datum G1.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <random>

#include "abbe/calib/mfb/run/points_of_interest.hpp"
#include "mfb_identification.hpp"

namespace abbe::tests::mfb {

using calib::Matrix3;

/// A polynomial and a wave over the travel, 0 at its begin.
struct SmoothError {
  std::array<double, 3> polynomial{};
  double amplitude = 0.0, phase = 0.0, period_m = 0.6;
  bool level_ends = false;  ///< straightness: 0 at both ends

  static constexpr double kTravel_m = 0.55;
  [[nodiscard]] double raw(double x_m) const {
    const double u = x_m / kTravel_m;
    return u * (polynomial[0] + u * (polynomial[1] + u * polynomial[2])) +
           amplitude * std::sin(2.0 * std::numbers::pi * x_m / period_m + phase);
  }
  [[nodiscard]] double at(double x_m) const {
    const double rise = level_ends ? raw(kTravel_m) - raw(0.0) : 0.0;
    return raw(x_m) - raw(0.0) - rise * x_m / kTravel_m;
  }
};

struct SimulatedMachine {
  /// translations x y z [m], then rotations x y z [rad] of X, Y, Z
  std::array<std::array<SmoothError, 6>, 3> error;
  double EA0Z = 0.0, EB0Z = 0.0, EC0Y = 0.0;

  explicit SimulatedMachine(std::mt19937_64& random, double scale = 1.0) {
    std::normal_distribution<double> normal;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t k = 0; k < 6; ++k) {
        SmoothError& e = error[axis][k];
        const bool straightness = k < 3 && k != axis;
        const double size = scale * (k < 3 ? (straightness ? 2e-6 : 10e-6) : 20e-6);
        for (double& c : e.polynomial) {
          c = size * normal(random);
        }
        e.amplitude = 0.15 * size * normal(random);
        e.phase = normal(random);
        e.period_m = 0.5 + 0.1 * std::abs(normal(random));
        e.level_ends = straightness;
      }
    }
    EA0Z = scale * 30e-6 * normal(random);
    EB0Z = scale * 30e-6 * normal(random);
    EC0Y = scale * 30e-6 * normal(random);
  }

  static Vector3 turned(const Vector3& rotation_rad, const Vector3& v) {
    const double angle = rotation_rad.norm();
    return angle > 0.0 ? Vector3(Eigen::AngleAxisd(angle, rotation_rad / angle) * v) : v;
  }
  [[nodiscard]] Vector3 moved(std::size_t axis, double q_m, const Vector3& v) const {
    const auto at = [&](std::size_t k) { return error[axis][k].at(q_m); };
    return turned({at(3), at(4), at(5)}, v) + Vector3(at(0), at(1), at(2));
  }
  /// Eq. 8: where the centre of the tip stands.
  [[nodiscard]] Vector3 tip_m(const Vector3& q_m, const Vector3& tool_m) const {
    Vector3 v = moved(2, q_m.z(), tool_m) + Vector3(0, 0, q_m.z());
    v = turned({EA0Z, EB0Z, 0.0}, v);
    v = moved(1, q_m.y(), v) + Vector3(0, q_m.y(), 0);
    v = turned({0.0, 0.0, EC0Y}, v);
    return moved(0, q_m.x(), v) + Vector3(q_m.x(), 0, 0);
  }
  [[nodiscard]] Vector3 reading_m(const Vector3& p_m, const Vector3& tool_m) const {
    Vector3 q = p_m - tool_m;
    for (int i = 0; i < 3; ++i) {  // each step divides the error by 10,000
      q -= tip_m(q, tool_m) - p_m;
    }
    return q;
  }

  /// The parameters that an identification should find.
  [[nodiscard]] Eigen::VectorXd truth(const calib::ParameterLayout& layout) const {
    Eigen::VectorXd U(static_cast<Eigen::Index>(layout.model_size()));
    for (const calib::Table& table : layout.tables()) {
      const auto axis = index(table.motion.axis);
      const auto k = static_cast<std::size_t>(table.motion.motion);
      auto i = static_cast<Eigen::Index>(table.offset);
      for (const double x_m : layout.nodes()[axis].nodes_m) {
        U(i++) = error[axis][k].at(x_m);
      }
    }
    U.tail<3>() << EA0Z, EB0Z, EC0Y;
    return U;
  }
};

/// One touch while it is made.
struct TouchMade {
  const calib::mfb::Measurement& measurement;
  calib::mfb::Target target;
  Vector3 place_m;    ///< of the tip, bar axes
  Vector3 outward;    ///< normal of the surface, machine axes
  double in_pass;     ///< share of the touches of the pass that were made before
  double in_session;  ///< the same of all passes
};

/// What happens during the measurements.
struct ProbingOptions {
  double noise = 1.0;        ///< factor of the noise of the plan
  double calibration = 1.0;  ///< factor of the errors of the calibration of the bar
  double drift_m = 0.0;      ///< of each pass, in a random direction
  double form_m = 0.0;       ///< form errors of the features, the same in all passes
  double origin_m = 0.5e-3, axes_rad = 0.5e-3;  ///< pose beside the plan
  std::optional<calib::Expansivity> expansion;  ///< as the bar states it
  double warmer_K = 0.0;                        ///< the bar above 20 degC, as measured
  /// In addition, by position.
  std::map<std::string, double> warmer_at_K{};
  double alpha_error_per_K = 0.0;
  std::optional<calib::mfb::Sag> sag;
  calib::mfb::TouchPattern pattern = paper_pattern();  ///< of the bar
  double place_m = 20e-6;  ///< of the features beside the pattern, in each direction
  bool signature = true;   ///< two holes are shifted by 1 mm
  /// Displacement of a touched place, bar axes; may be empty.
  std::function<Vector3(const TouchMade&)> displaced{};
  /// Error of the machine at a reading beside that of ReadingOf, machine axes; may be empty.
  std::function<Vector3(const TouchMade&, const Vector3& reading_m)> more_error_m{};
};

struct ProbedBar {
  calib::mfb::Bar bar;
  std::vector<calib::mfb::PassTouches> touches;
};

/// The bar as it is: holes and rods are not where the pattern has them.
struct TrueBar {
  calib::mfb::TouchPattern pattern;
  std::vector<Vector3> hole_m, rod_m;
  std::vector<double> form_m;  ///< of each touch along its normal

  TrueBar(std::mt19937_64& random, const ProbingOptions& options) : pattern(options.pattern) {
    if (!options.signature) {
      pattern.hole_y_m.assign(pattern.holes(), 0.0);
    }
    std::normal_distribution<double> normal;
    const auto off = [&] {
      return Vector3(options.place_m * Vector3(normal(random), normal(random), normal(random)));
    };
    for (std::size_t i = 0; i < pattern.holes(); ++i) {
      hole_m.push_back(off());
    }
    for (std::size_t j = 0; j < pattern.rod_x_m.size(); ++j) {
      rod_m.push_back(off());
    }
    for (std::size_t k = 0; k < pattern.count(); ++k) {
      form_m.push_back(options.form_m * normal(random));
    }
  }
  /// Centres of the tip in bar axes, in the fixed order.
  [[nodiscard]] std::vector<Vector3> tips_m(double tip_radius_m) const {
    std::vector<Vector3> tips;
    for (const auto& touch : calib::mfb::nominal_touches(pattern, tip_radius_m)) {
      const bool hole = touch.target.feature == calib::mfb::Feature::Hole;
      Vector3 off = hole ? hole_m[touch.target.index] : rod_m[touch.target.index];
      if (touch.target.feature == calib::mfb::Feature::Plane) {
        off.x() = off.z() = 0.0;
      }
      tips.emplace_back(touch.tip_m + off + form_m[tips.size()] * touch.outward);
    }
    return tips;
  }
};

/// The points of one pass by feature.
inline calib::mfb::BarTouches by_feature(const std::vector<calib::mfb::NominalTouch>& nominal,
                                         const std::vector<Vector3>& points_m) {
  calib::mfb::BarTouches touches;
  for (std::size_t k = 0; k < nominal.size(); ++k) {
    const calib::mfb::Target& t = nominal[k].target;
    if (t.feature == calib::mfb::Feature::Hole) {
      touches.holes_m.resize(t.index + 1);
      touches.holes_m.back().push_back(points_m[k]);
    } else if (t.feature == calib::mfb::Feature::Rod) {
      touches.rods_m.resize(t.index + 1);
      touches.rods_m.back().push_back(points_m[k]);
    } else {
      touches.planes_m.resize(t.index + 1);
      touches.planes_m.back()[static_cast<std::size_t>(t.side)].push_back(points_m[k]);
    }
  }
  return touches;
}

/// Where the bar stands in its position, relative to the plan.
struct Clamping {
  Vector3 moved_m, turned_rad;
};

/// The readings of a machine when the centre of the tip is at a place.
using ReadingOf = std::function<Vector3(const Vector3& p_m, const Vector3& tool_m)>;

/// Probes a bar with a machine.
class Probing {
 public:
  Probing(ReadingOf reading_m, const calib::mfb::Plan& plan, std::mt19937_64& random,
          const ProbingOptions& options)
      : reading_m_(std::move(reading_m)),
        plan_(plan),
        options_(options),
        random_(random),
        bar_(random, options),
        nominal_(calib::mfb::nominal_touches(bar_.pattern, plan.tip_radius_m)),
        tips_m_(bar_.tips_m(plan.tip_radius_m)) {}

  /// The bar as its calibration states it.
  calib::mfb::Bar calibrated() {
    const auto shape = points_of_interest(by_feature(nominal_, tips_m_), Matrix3::Identity());
    calib::mfb::Bar bar = bar_with(shape->O_bar_m);
    bar.pattern = bar_.pattern;
    bar.expansion = options_.expansion;
    bar.sag = options_.sag;
    const Eigen::VectorXd u_m = bar.covariance_m2.diagonal().cwiseSqrt();
    for (std::size_t i = 0; i < bar.O_m.size(); ++i) {
      const Vector3 u = u_m.segment<3>(3 * static_cast<Eigen::Index>(i));
      bar.O_m[i] += options_.calibration * u.cwiseProduct(deviates());
    }
    return bar;
  }

  /// `before`: time since the begin of the drift, in passes.
  calib::mfb::PassTouches pass(const calib::mfb::Measurement& m, const Clamping& clamping,
                               const Vector3& drift_m, double before) {
    const bool backward = m.direction == calib::mfb::PassDirection::Backward;
    std::vector<std::size_t> order = calib::mfb::probing_order(nominal_);
    if (backward) {
      std::reverse(order.begin(), order.end());
    }
    calib::mfb::PassTouches touches;
    const double passes = static_cast<double>(plan_.measurements.size());
    for (const std::size_t k : order) {
      const double share =
          static_cast<double>(touches.size()) / static_cast<double>(order.size() - 1);
      const double time = before + share;
      const TouchMade made{m,          nominal_[k].target,
                           tips_m_[k], m.axes() * nominal_[k].outward,
                           share,      (static_cast<double>(passes_made_) + share) / passes};
      const Vector3 p_m = m.origin_m + clamping.moved_m + m.axes() * in_bar_m(k, m, clamping, made);
      const Vector3 noise_m = plan_.noise.machine_m * deviates() + plan_.noise.probe_m *
                                                                       normal_(random_) * m.axes() *
                                                                       nominal_[k].outward;
      Vector3 reading_m = reading_m_(p_m, m.tool_offset_m);
      if (options_.more_error_m) {
        reading_m -= options_.more_error_m(made, reading_m);
      }
      touches.push_back(
          {nominal_[k].target, reading_m + options_.noise * noise_m + time * drift_m, false});
    }
    ++passes_made_;
    return touches;
  }

  Vector3 deviates() { return {normal_(random_), normal_(random_), normal_(random_)}; }

 private:
  Vector3 in_bar_m(std::size_t k, const calib::mfb::Measurement& m, const Clamping& clamping,
                   const TouchMade& made) const {
    const double alpha_per_K = options_.expansion ? options_.expansion->alpha_per_K : 0.0;
    const auto at = options_.warmer_at_K.find(m.position);
    const double warmer_K =
        options_.warmer_K + (at == options_.warmer_at_K.end() ? 0.0 : at->second);
    Vector3 p_m = (1.0 + warmer_K * (alpha_per_K + options_.alpha_error_per_K)) * tips_m_[k];
    if (options_.sag) {
      p_m += sag_m(*options_.sag, tips_m_[k].x(), m.axes().transpose() * plan_.gravity);
    }
    if (options_.displaced) {
      p_m += options_.displaced(made);
    }
    return SimulatedMachine::turned(clamping.turned_rad, p_m);
  }

  ReadingOf reading_m_;
  const calib::mfb::Plan& plan_;
  ProbingOptions options_;
  std::mt19937_64& random_;
  std::normal_distribution<double> normal_;
  TrueBar bar_;
  std::vector<calib::mfb::NominalTouch> nominal_;
  std::vector<Vector3> tips_m_;
  std::size_t passes_made_ = 0;
};

inline ProbedBar probe(ReadingOf reading_m, const calib::mfb::Plan& plan, std::mt19937_64& random,
                       const ProbingOptions& options = {}) {
  Probing probing(std::move(reading_m), plan, random, options);
  ProbedBar probed{probing.calibrated(), {}};
  std::map<std::string, Clamping> clampings;
  const auto forward_of = calib::mfb::pairs_of(plan.measurements);
  std::vector<Vector3> drift_m;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const calib::mfb::Measurement& m = plan.measurements[i];
    if (clampings.count(m.position) == 0) {
      clampings[m.position] = {options.origin_m * probing.deviates(),
                               options.axes_rad * probing.deviates()};
    }
    drift_m.push_back(forward_of[i] ? drift_m[*forward_of[i]]
                                    : options.drift_m * probing.deviates().normalized());
    probed.touches.push_back(
        probing.pass(m, clampings[m.position], drift_m.back(), forward_of[i] ? 1.0 : 0.0));
  }
  return probed;
}

inline ProbedBar probe(const SimulatedMachine& machine, const calib::mfb::Plan& plan,
                       std::mt19937_64& random, const ProbingOptions& options = {}) {
  return probe([&machine](const Vector3& p_m,
                          const Vector3& tool_m) { return machine.reading_m(p_m, tool_m); },
               plan, random, options);
}

/// Every measurement forward, then backward.
inline calib::mfb::Plan with_pairs(const calib::mfb::Plan& plan) {
  calib::mfb::Plan pairs = plan;
  pairs.measurements.clear();
  for (calib::mfb::Measurement m : plan.measurements) {
    pairs.measurements.push_back(m);
    m.name += " back";
    m.direction = calib::mfb::PassDirection::Backward;
    pairs.measurements.push_back(m);
  }
  return pairs;
}

/// The plan of the paper with a tip of 1.5 mm radius.
inline calib::mfb::Plan paper_plan() {
  calib::mfb::Plan plan = plan_of(reference("identification_reference.json").at("cases").at(1));
  plan.tip_radius_m = 1.5e-3;
  return plan;
}

}  // namespace abbe::tests::mfb
