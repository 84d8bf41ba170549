#include "abbe/sim/mfb/probing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "abbe/result/try.hpp"
#include "abbe/sim/mfb/clamped_bar.hpp"
#include "abbe/sim/touching.hpp"
#include "mfb/numbers.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

/// The first measurement in the plan with the same position and tool.
std::size_t first_with_tool(std::span<const Measurement> plan, std::size_t m) {
  const auto same = [&](const Measurement& other) {
    return other.position == plan[m].position && other.tool_offset_m == plan[m].tool_offset_m;
  };
  return static_cast<std::size_t>(std::find_if(plan.begin(), plan.end(), same) - plan.begin());
}

/// The feature of a turned bar that is at the place of the feature `planned`.
Feature feature_there(const Feature& planned, Turned turned, std::size_t holes) {
  Feature f = planned;
  const std::size_t count = f.kind == Kind::Hole ? holes : holes - 1;
  if (turned != Turned::AboutX) f.index = count - 1 - f.index;
  if (turned != Turned::AboutY) f.side = f.side == Side::Left ? Side::Right : Side::Left;
  if (f.kind != Kind::Plane) f.side = Side::Left;
  return f;
}

/// One pass: the quantities that all its touches share.
class PassProbing {
 public:
  PassProbing(const TruthMachine& machine, const TrueBar& bar, std::span<const Measurement> plan,
              std::size_t m, const ProbingOptions& options)
      : machine_(machine),
        clamped_(clamped(bar, plan, m, options)),
        plan_(plan),
        m_(m),
        options_(options),
        all_(clamped_.all) {
    machine_.target_offset_m = plan[m].tool_offset_m;
    set_drift();
  }

  [[nodiscard]] double temperature_C() const { return clamped_.stated_C; }

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
  /// Sets the drift. It continues from a pass (times 0 to 1) to its backward pass (times 1 to 2).
  void set_drift() {
    const std::size_t first = first_with_tool(plan_, m_);
    const Numbers draw{options_.seed, NoiseStream::BarPose, plan_.size() + first};
    for (Eigen::Index k = 0; k < 3; ++k)
      drift_m_(k) = std::copysign(options_.drift_m, draw.number(static_cast<std::uint64_t>(k)));
    passes_before_ = first == m_ ? 0.0 : 1.0;
  }

  /// Centre of the tip in contact with the loaded bar, in the frame of the plan.
  [[nodiscard]] Vector3d tip_in_plan_m(const Target& planned) const {
    Target there = planned;
    const TrueBar& bar = clamped_.bar;
    if (clamped_.turned) {
      const Eigen::Isometry3d T_bar_planned = clamped_.T_planned_bar.inverse();
      there.feature = feature_there(planned.feature, *clamped_.turned, bar.pattern.hole_x_m.size());
      there.place_m = T_bar_planned * planned.place_m;
      there.normal = T_bar_planned.linear() * planned.normal;
    }
    const auto same = std::find_if(all_.begin(), all_.end(), [&](const Target& t) {
      return t.feature == there.feature && t.k == there.k;
    });
    const Contact touched = contact(bar, there, static_cast<std::size_t>(same - all_.begin()),
                                    options_.probe.tip_radius_m);

    const double x_m = touched.surface_m.x();
    const Vector3d grown_m = touched.centre_m + (clamped_.growth - 1.0) * touched.surface_m;
    return clamped_.T_planned_bar * (grown_m + clamped_.displacement_m(x_m));
  }

  /// Distance from the contact to the trigger, along the approach.
  [[nodiscard]] double pretravel_m(const Vector3d& normal, const Numbers& draw) const {
    const Probe& probe = options_.probe;
    const double feed_m_per_s = probe.feed_m_per_s * (1.0 + probe.feed_scatter * draw.number(0));
    const double phi_rad = std::atan2(-normal.y(), -normal.x());
    const double across = std::hypot(normal.x(), normal.y());
    return probe.delay_s * feed_m_per_s + probe.lobing_m * std::cos(3.0 * phi_rad) * across +
           probe.noise_m * draw.number(1);
  }

  [[nodiscard]] Vector3d normal_of(const Target& target) const {
    return clamped_.T_machine_planned.linear() * target.normal;
  }

  [[nodiscard]] Vector3d reading_m(std::size_t number, double time, const std::string& key) const {
    const Target& target = all_[number];
    const Numbers draw{options_.seed, NoiseStream::BarTouch, m_ * all_.size() + number};
    const Vector3d normal = normal_of(target);
    Vector3d tip_m = clamped_.T_machine_planned * tip_in_plan_m(target);
    tip_m += (time + passes_before_) * drift_m_ - pretravel_m(normal, draw) * normal;

    const auto wrong = options_.wrong_m.find(key);
    if (wrong != options_.wrong_m.end()) tip_m += wrong->second * normal;
    return reading_at_m(machine_, tip_m) + options_.machine_noise_m * draw.vector(2);
  }

  TruthMachine machine_;
  ClampedBar clamped_;
  std::span<const Measurement> plan_;
  std::size_t m_;
  const ProbingOptions& options_;
  const std::vector<Target>& all_;

  Vector3d drift_m_ = Vector3d::Zero();  // drift of this pass
  double passes_before_ = 0.0;
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
  ABBE_TRY(check_names(bar, plan, options));

  ProbedBar probed;
  for (std::size_t m = 0; m < plan.size(); ++m) {
    const PassProbing pass(machine, bar, plan, m, options);
    probed.temperature_C.push_back(pass.temperature_C());
    pass.touch_all(probed.touches);
  }
  return probed;
}

}  // namespace abbe::sim::mfb
