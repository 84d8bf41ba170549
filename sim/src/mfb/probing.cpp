#include "abbe/sim/mfb/probing.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "abbe/sim/noise.hpp"
#include "abbe/sim/touching.hpp"
#include "mfb/constants.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Random numbers of one thing (pose, touch, ...): the n-th number of the `index`-th one.
struct Numbers {
  std::uint64_t seed;
  NoiseStream stream;
  std::uint64_t index;

  [[nodiscard]] double number(std::uint64_t n) const {
    constexpr std::uint64_t kMostNumbers = 4096;
    return gaussian(seed, stream, index * kMostNumbers + n);
  }
  [[nodiscard]] Vector3d vector(std::uint64_t n) const {
    return {number(n), number(n + 1), number(n + 2)};
  }
};

Matrix3d rotation(const Vector3d& rotation_rad) {
  return Eigen::AngleAxisd(rotation_rad.norm(), rotation_rad.stableNormalized()).toRotationMatrix();
}

/// The first measurement in the plan with the same position (and tool).
std::size_t first_at_position(std::span<const Measurement> plan, std::size_t m) {
  const auto same = [&](const Measurement& other) { return other.position == plan[m].position; };
  return static_cast<std::size_t>(std::find_if(plan.begin(), plan.end(), same) - plan.begin());
}
std::size_t first_with_tool(std::span<const Measurement> plan, std::size_t m) {
  const auto same = [&](const Measurement& other) {
    return other.position == plan[m].position && other.tool_offset_m == plan[m].tool_offset_m;
  };
  return static_cast<std::size_t>(std::find_if(plan.begin(), plan.end(), same) - plan.begin());
}

/// T_machine_bar of the bar as clamped, and not turned.
Isometry3d pose_of(const Measurement& m, double length_m, const ProbingOptions& options,
                   std::uint64_t position) {
  const Numbers draw{options.seed, NoiseStream::BarPose, position};
  const Vector3d middle_m(0.5 * length_m, 0.0, 0.0);
  Matrix3d axes;
  axes << m.bar_x, m.bar_z.cross(m.bar_x), m.bar_z;

  Isometry3d T_machine_bar = Isometry3d::Identity();
  T_machine_bar.translate(m.origin_m + options.clamping_m * draw.vector(0));
  T_machine_bar.rotate(axes);
  T_machine_bar.translate(middle_m);
  T_machine_bar.rotate(rotation(options.clamping_rad * draw.vector(3)));
  T_machine_bar.translate(-middle_m);
  return T_machine_bar;
}

/// T_planned_bar of a bar that lies turned about an axis through its middle.
Isometry3d turned_pose(Turned turned, double length_m) {
  constexpr double kHalfTurn_rad = 3.14159265358979323846;
  const Vector3d middle_m(0.5 * length_m, 0.0, 0.0);
  Isometry3d T = Isometry3d::Identity();
  T.translate(middle_m);
  T.rotate(Eigen::AngleAxisd(kHalfTurn_rad, Vector3d::Unit(static_cast<Eigen::Index>(turned))));
  T.translate(-middle_m);
  return T;
}

/// The feature of a turned bar that lies where `planned` should be.
Feature feature_there(const Feature& planned, Turned turned, std::size_t holes) {
  Feature f = planned;
  const std::size_t count = f.kind == Kind::Hole ? holes : holes - 1;
  if (turned != Turned::AboutX) f.index = count - 1 - f.index;
  if (turned != Turned::AboutY) f.side = f.side == Side::Left ? Side::Right : Side::Left;
  if (f.kind != Kind::Plane) f.side = Side::Left;
  return f;
}

/// One pass: everything that its touches have in common.
class PassProbing {
 public:
  PassProbing(const TruthMachine& machine, const TrueBar& bar, std::span<const Measurement> plan,
              std::size_t m, const ProbingOptions& options)
      : machine_(machine), bar_(bar), plan_(plan), m_(m), options_(options) {
    machine_.target_offset_m = plan[m].tool_offset_m;
    const std::size_t position = first_at_position(plan, m);
    T_machine_planned_ = pose_of(plan[m], bar.pattern.length_m(), options, position);
    turned_ = how_turned();
    if (turned_) T_planned_bar_ = turned_pose(*turned_, bar.pattern.length_m());
    set_temperature(position);
    set_drift();
    set_shape();
    all_ = targets(bar.pattern, plan[m].probed);
  }

  [[nodiscard]] double temperature_C() const { return stated_C_; }

  void touch_all(std::vector<Touch>& touches) const {
    for (std::size_t row = 0; row < all_.size(); ++row) {
      const bool forward = plan_[m_].pass == Pass::Forward;
      const std::size_t number = forward ? row : all_.size() - 1 - row;
      const std::string key = plan_[m_].name + "," + name(all_[number]);
      if (options_.missed.contains(key)) continue;
      const double time = static_cast<double>(row) / static_cast<double>(all_.size() - 1);
      touches.push_back({m_, all_[number], reading_m(number, time, key), normal_of(all_[number])});
    }
  }

 private:
  [[nodiscard]] std::optional<Turned> how_turned() const {
    for (const std::string& key : {plan_[m_].name, plan_[m_].position}) {
      const auto found = options_.turned.find(key);
      if (found != options_.turned.end()) return found->second;
    }
    return std::nullopt;
  }

  void set_temperature(std::uint64_t position) {
    const BarTemperature& t = options_.temperature;
    const Numbers at_position{options_.seed, NoiseStream::BarTemperature, position + 1};
    const Numbers of_bar{options_.seed, NoiseStream::BarTemperature, 0};
    stated_C_ = t.stated_C + t.spread_K * at_position.number(0);
    const double true_C = stated_C_ + t.u_K * at_position.number(1);
    const double alpha_per_K = t.alpha_per_K + t.u_alpha_per_K * of_bar.number(0);
    growth_ = 1.0 + alpha_per_K * (true_C - kReference_C);
  }

  /// Drift runs through a pass and its way back: times 0 to 1, 1 to 2.
  void set_drift() {
    const std::size_t first = first_with_tool(plan_, m_);
    const Numbers draw{options_.seed, NoiseStream::BarPose, plan_.size() + first};
    for (Eigen::Index k = 0; k < 3; ++k)
      drift_m_(k) = std::copysign(options_.drift_m, draw.number(static_cast<std::uint64_t>(k)));
    passes_before_ = first == m_ ? 0.0 : 1.0;
  }

  void set_shape() {
    const Numbers draw{options_.seed, NoiseStream::BarShape, m_};
    const std::size_t holes = bar_.pattern.hole_x_m.size();
    shape_m_.assign(holes, Vector3d::Zero());
    for (std::size_t i = 1; i < holes; ++i)
      shape_m_[i] = options_.shape_scatter_m * draw.vector(3 * i);
    shape_m_.back().tail<2>().setZero();
  }

  /// Displacement by the clamping at x of the bar, linear between the holes.
  [[nodiscard]] Vector3d shape_at(double x_m) const {
    const auto& at_m = bar_.pattern.hole_x_m;
    const auto above = std::upper_bound(at_m.begin() + 1, at_m.end() - 1, x_m);
    const auto i = static_cast<std::size_t>(above - at_m.begin());
    const double u = std::clamp((x_m - at_m[i - 1]) / (at_m[i] - at_m[i - 1]), 0.0, 1.0);
    return (1.0 - u) * shape_m_[i - 1] + u * shape_m_[i];
  }

  [[nodiscard]] Vector3d sag_at(double x_m) const {
    if (!options_.sag) return Vector3d::Zero();
    const Vector3d g =
        (T_machine_planned_ * T_planned_bar_).linear().transpose() * options_.gravity.normalized();
    const auto& [height_y_m, height_z_m] = options_.sag->section_yz_m;
    return {0.0, g.y() * sag_m(*options_.sag, height_y_m, x_m),
            g.z() * sag_m(*options_.sag, height_z_m, x_m)};
  }

  /// Centre of the tip in contact with the loaded bar, in the frame of the plan.
  [[nodiscard]] Vector3d tip_in_plan_m(const Target& planned) const {
    Target there = planned;
    if (turned_) {
      const Isometry3d T_bar_planned = T_planned_bar_.inverse();
      there.feature = feature_there(planned.feature, *turned_, bar_.pattern.hole_x_m.size());
      there.place_m = T_bar_planned * planned.place_m;
      there.normal = T_bar_planned.linear() * planned.normal;
    }
    const auto same = std::find_if(all_.begin(), all_.end(), [&](const Target& t) {
      return t.feature == there.feature && t.k == there.k;
    });
    const Contact touched = contact(bar_, there, static_cast<std::size_t>(same - all_.begin()),
                                    options_.probe.tip_radius_m);

    const double x_m = touched.surface_m.x();
    const Vector3d grown_m = touched.centre_m + (growth_ - 1.0) * touched.surface_m;
    return T_planned_bar_ * (grown_m + sag_at(x_m) + shape_at(x_m));
  }

  /// How far behind the contact the trigger comes, along the approach.
  [[nodiscard]] double pretravel_m(const Vector3d& normal, const Numbers& draw) const {
    const Probe& probe = options_.probe;
    const double feed_m_per_s = probe.feed_m_per_s * (1.0 + probe.feed_scatter * draw.number(0));
    const double phi_rad = std::atan2(-normal.y(), -normal.x());
    const double across = std::hypot(normal.x(), normal.y());
    return probe.delay_s * feed_m_per_s + probe.lobing_m * std::cos(3.0 * phi_rad) * across +
           probe.noise_m * draw.number(1);
  }

  [[nodiscard]] Vector3d normal_of(const Target& target) const {
    return T_machine_planned_.linear() * target.normal;
  }

  [[nodiscard]] Vector3d reading_m(std::size_t number, double time, const std::string& key) const {
    const Target& target = all_[number];
    const Numbers draw{options_.seed, NoiseStream::BarTouch, m_ * all_.size() + number};
    const Vector3d normal = normal_of(target);
    Vector3d tip_m = T_machine_planned_ * tip_in_plan_m(target);
    tip_m += (time + passes_before_) * drift_m_ - pretravel_m(normal, draw) * normal;

    const auto wrong = options_.wrong_m.find(key);
    if (wrong != options_.wrong_m.end()) tip_m += wrong->second * normal;
    return reading_at_m(machine_, tip_m) + options_.machine_noise_m * draw.vector(2);
  }

  TruthMachine machine_;
  const TrueBar& bar_;
  std::span<const Measurement> plan_;
  std::size_t m_;
  const ProbingOptions& options_;
  std::vector<Target> all_;

  Isometry3d T_machine_planned_ = Isometry3d::Identity();
  Isometry3d T_planned_bar_ = Isometry3d::Identity();
  std::optional<Turned> turned_;
  double stated_C_ = kReference_C, growth_ = 1.0;
  Vector3d drift_m_ = Vector3d::Zero();  // per pass
  double passes_before_ = 0.0;
  std::vector<Vector3d> shape_m_;  // by hole
};

Result<void> check_names(const TrueBar& bar, std::span<const Measurement> plan,
                         const ProbingOptions& options) {
  std::set<std::string> places;
  for (const Measurement& m : plan) places.insert({m.name, m.position});
  for (const auto& [key, turned] : options.turned) {
    if (!places.contains(key)) {
      return bad_input(
          fmt::format("bar turned in \"{}\": the plan has no such measurement or "
                      "position; the first ones are {} and {}",
                      key, plan.front().name, plan.front().position));
    }
  }

  std::set<std::string> touches;
  const std::vector<Target> all = targets(bar.pattern);
  for (const Measurement& m : plan)
    for (const Target& target : all) touches.insert(m.name + "," + name(target));
  std::set<std::string> asked = options.missed;
  for (const auto& [key, wrong] : options.wrong_m) asked.insert(key);
  for (const std::string& key : asked) {
    if (!touches.contains(key)) {
      return bad_input(
          fmt::format("touch \"{}\": the plan has no such touch; write measurement,"
                      "feature,index,side,k as in points.csv, for example \"{}\"",
                      key, *touches.begin()));
    }
  }
  return {};
}

}  // namespace

Result<ProbedBar> probe_bar(const TruthMachine& machine, const TrueBar& bar,
                            std::span<const Measurement> plan, const ProbingOptions& options) {
  if (options.probe.tip_radius_m >= 0.8 * bar.pattern.hole_radius_m) {
    return bad_input(
        fmt::format("tip radius {} mm: must be below 0.8 of the radius of a hole, {} mm",
                    1e3 * options.probe.tip_radius_m, 1e3 * bar.pattern.hole_radius_m));
  }
  if (auto known = check_names(bar, plan, options); !known) return tl::unexpected(known.error());

  ProbedBar probed;
  for (std::size_t m = 0; m < plan.size(); ++m) {
    const PassProbing pass(machine, bar, plan, m, options);
    probed.temperature_C.push_back(pass.temperature_C());
    pass.touch_all(probed.touches);
  }
  return probed;
}

}  // namespace abbe::sim::mfb
