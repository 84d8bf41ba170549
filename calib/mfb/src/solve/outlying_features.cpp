#include "solve/outlying_features.hpp"

#include <array>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/observe/pass_touches.hpp"
#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::mfb {
namespace {

/// Residuals of the fit of one feature.
struct FeatureOfPass {
  std::string name;  ///< such as "R2: hole 6"
  double rms_m = 0.0;
};
/// Features of all passes, grouped by kind (the index is the value of Feature).
using FeaturesOfPasses = std::array<std::vector<FeatureOfPass>, 3>;

void add_features(const Measurement& m, const BarFeatures& features, FeaturesOfPasses& all) {
  const auto add = [&](Feature kind, const std::string& name, double rms_m) {
    all[static_cast<std::size_t>(kind)].push_back({message(m.name, ": ", name), rms_m});
  };
  for (std::size_t i = 0; i < features.holes.size(); ++i) {
    add(Feature::Hole, hole_name(i), features.holes[i].residuals.rms);
  }
  for (std::size_t j = 0; j < features.rods.size(); ++j) {
    add(Feature::Rod, rod_name(j), features.rods[j].residuals.rms);
    for (const Side side : {Side::Left, Side::Right}) {
      const auto& plane = features.planes[j][static_cast<std::size_t>(side)];
      add(Feature::Plane, plane_name(j, side), plane.residuals.rms);
    }
  }
}

double median_rms_m(const std::vector<FeatureOfPass>& features) {
  std::vector<double> rms_m;
  for (const FeatureOfPass& f : features) {
    rms_m.push_back(f.rms_m);
  }
  return median(rms_m);
}

}  // namespace

std::vector<std::string> outlying_features(const Bar& bar, const Plan& plan,
                                           std::span<const PassTouches> touches) {
  constexpr double kWorse = 5.0;
  constexpr double kRoundingOfTouches_m = 1e-9;  // for simulated touches without noise
  FeaturesOfPasses all;
  for (std::size_t m = 0; m < plan.measurements.size(); ++m) {
    const Measurement& measurement = plan.measurements[m];
    const auto features =
        sorted_touches(bar.pattern, measurement, touches[m]).and_then([&](const SortedTouches& s) {
          return fit_features(bar_touches(bar.pattern, s.place, s.tip_m), measurement.axes());
        });
    if (features) {
      add_features(measurement, *features, all);
    }
  }

  std::vector<std::string> notes;
  for (const auto& features : all) {
    const double usual_m = median_rms_m(features);
    for (const FeatureOfPass& f : features) {
      if (f.rms_m > kWorse * usual_m + kRoundingOfTouches_m) {
        notes.push_back(message(f.name, ": residuals of ", kUmPerM * f.rms_m, " um rms, usual are ",
                                kUmPerM * usual_m,
                                " um: a touch is wrong (dirt, a false trigger); touch it again"));
      }
    }
  }
  return notes;
}

}  // namespace abbe::calib::mfb
