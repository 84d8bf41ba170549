#include "abbe/calib/mfb/observe/reading_mistakes.hpp"

#include <algorithm>
#include <functional>
#include <vector>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr double kNearPlan_m = 20e-3;

/// The centre of the tip from a reading and the tool offset of its measurement.
using TipOfReading = std::function<Vector3(const Vector3& reading_m, const Vector3& tool_m)>;

/// The planned places of all touches. fit() is true if every touch is near its planned place.
class PlannedPlaces {
 public:
  PlannedPlaces(const Bar& bar, const Plan& plan)
      : pattern_(bar.pattern), touches_(nominal_touches(bar.pattern, plan.tip_radius_m)) {}

  [[nodiscard]] bool fit(const PassTouches& pass, const Measurement& m,
                         const TipOfReading& tip) const {
    const Matrix3 axes = m.axes();
    return std::ranges::all_of(pass, [&](const Touch& touch) {
      const auto place = pattern_.place_of(touch.target);
      if (!place) {
        return false;
      }
      const Vector3 planned_m = m.origin_m + axes * touches_[*place].tip_m;
      return (tip(touch.reading_m, m.tool_offset_m) - planned_m).norm() < kNearPlan_m;
    });
  }
  [[nodiscard]] bool fit(std::span<const PassTouches> passes, const Plan& plan,
                         const TipOfReading& tip) const {
    for (std::size_t i = 0; i < passes.size(); ++i) {
      if (!fit(passes[i], plan.measurements[i], tip)) {
        return false;
      }
    }
    return true;
  }

 private:
  const TouchPattern& pattern_;
  std::vector<NominalTouch> touches_;
};

Vector3 as_given(const Vector3& reading_m, const Vector3& tool_m) {
  return reading_m + tool_m;
}

/// Texts of the corrections that concern all readings and explain them.
std::vector<std::string> common_corrections(const PlannedPlaces& places,
                                            std::span<const PassTouches> passes, const Plan& plan) {
  std::vector<std::string> texts;
  const auto try_correction = [&](const std::string& text, const TipOfReading& tip) {
    if (places.fit(passes, plan, tip)) {
      texts.push_back(text);
    }
  };

  for (const AxisMistake& mistake : axis_mistakes()) {
    try_correction(mistake.text, [&mistake](const Vector3& q, const Vector3& t) {
      return Vector3(mistake.M * q + t);
    });
  }
  for (const UnitMistake& mistake : unit_mistakes()) {
    try_correction(mistake.text, [&mistake](const Vector3& q, const Vector3& t) {
      return Vector3(mistake.factor * q + t);
    });
  }
  try_correction("tool offsets of the opposite sign",
                 [](const Vector3& q, const Vector3& t) { return Vector3(q - t); });
  try_correction("positions of the tip instead of scale readings",
                 [](const Vector3& q, const Vector3&) { return q; });
  return texts;
}

/// Text such as "; the touches of Y1 fit measurement Y2" for each pass that fits only another
/// measurement.
std::string exchanged_measurements(const PlannedPlaces& places, std::span<const PassTouches> passes,
                                   const Plan& plan) {
  std::string text;
  for (std::size_t i = 0; i < passes.size(); ++i) {
    if (places.fit(passes[i], plan.measurements[i], as_given)) {
      continue;
    }
    const auto other = std::ranges::find_if(plan.measurements, [&](const Measurement& m) {
      return places.fit(passes[i], m, as_given);
    });
    if (other != plan.measurements.end()) {
      text +=
          message("; the touches of ", plan.measurements[i].name, " fit measurement ", other->name);
    }
  }
  return text;
}

}  // namespace

std::string corrections_to_plan(const Bar& bar, const Plan& plan,
                                std::span<const PassTouches> passes) {
  const PlannedPlaces places(bar, plan);
  if (places.fit(passes, plan, as_given)) {
    return "";
  }
  const std::vector<std::string> texts = common_corrections(places, passes, plan);
  return texts.empty() ? exchanged_measurements(places, passes, plan)
                       : "; the readings fit the plan with " + or_list(texts);
}

}  // namespace abbe::calib::mfb
