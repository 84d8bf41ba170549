#include "solve/set_aside_touches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "observe/observations.hpp"

namespace abbe::calib::mfb {
namespace {

/// Standard deviation of a touch from many estimates `sigma_m` with k degrees of freedom each:
/// their median, divided by the median of sqrt(chi-square / k) ([Wilson 1931]).
double typical_sigma_m(std::vector<double> sigma_m, std::size_t k) {
  const double a = 1.0 - 2.0 / (9.0 * static_cast<double>(k));
  return median(sigma_m) / std::sqrt(a * a * a);
}

bool keeps_enough(const ResidualsOfFeature& f, const TouchPattern& pattern) {
  const Feature kind = f.feature.feature;
  const std::size_t fewest = kind == Feature::Plane ? kFewestOfPlane : kFewestOfCylinder;
  return f.k.size() > std::min(fewest, pattern.touches_of(kind));
}

/// Distances of the touches of planes from the middle of the bar along y, for each pass.
class PlanesInBar {
 public:
  PlanesInBar(const Observations& o, const std::vector<BarPose>& poses,
              const std::vector<ResidualsOfFeature>& all)
      : pattern_(o.bar.pattern) {
    for (const PassObservation& pass : o.passes) {
      const BarPose& pose = poses[pass.position];
      for (const ResidualsOfFeature& f : all) {
        for (std::size_t i = 0; f.measurement == pass.measurement && i < f.k.size(); ++i) {
          Target target = f.feature;
          target.k = f.k[i];
          if (target.feature == Feature::Plane) {
            y_m_[pass.measurement][*pattern_.place_of(target)] =
                pose.axes.col(1).dot(f.corrected_m[i] - pose.origin_m);
          }
        }
      }
    }
  }

  /// Distance of a touch from its median over the other passes, minus the mean of this distance
  /// over the other planes of the pass: the constants of a second tool and a drift displace all
  /// planes of a pass.
  [[nodiscard]] double off_m(std::size_t measurement, const Target& target) const {
    double sum_m = 0.0;
    std::size_t count = 0;
    for (const auto& [place, y_m] : y_m_.at(measurement)) {
      if (plane_of(place) != plane_of(*pattern_.place_of(target))) {
        sum_m += y_m - elsewhere_m(measurement, place);
        ++count;
      }
    }
    const std::size_t place = *pattern_.place_of(target);
    return y_m_.at(measurement).at(place) - elsewhere_m(measurement, place) -
           sum_m / static_cast<double>(std::max<std::size_t>(count, 1));
  }

 private:
  /// Number of the plane to which a touch belongs.
  [[nodiscard]] std::size_t plane_of(std::size_t place) const {
    return (place - *pattern_.place_of({Feature::Plane, 0, Side::Left, 0})) /
           pattern_.touches_of(Feature::Plane);
  }
  [[nodiscard]] double elsewhere_m(std::size_t measurement, std::size_t place) const {
    std::vector<double> others_m;
    for (const auto& [other, y_m] : y_m_) {
      if (const auto at = y_m.find(place); other != measurement && at != y_m.end()) {
        others_m.push_back(at->second);
      }
    }
    return median(others_m);
  }

  TouchPattern pattern_;
  std::map<std::size_t, std::map<std::size_t, double>> y_m_;  ///< by measurement, then by place
};

/// The touches without which the residuals of the feature are smallest. Touches cannot be
/// distinguished if their sums of squares differ only by noise.
Suspects suspects_in(const ResidualsOfFeature& f, const Matrix3& axes, double scale_m) {
  constexpr double kAlike = 3.0;
  struct Candidate {
    std::size_t place;
    WithoutTouch without;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < f.k.size(); ++i) {
    if (const auto without = without_touch(f, i, axes)) {
      candidates.push_back({i, *without});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.without.squares_m2 < b.without.squares_m2;
  });

  Suspects found{.measurement = f.measurement};
  const auto fewer = static_cast<double>(std::max<std::size_t>(f.degrees_of_freedom, 2) - 1);
  for (const Candidate& c : candidates) {
    const double more_m2 = c.without.squares_m2 - candidates.front().without.squares_m2;
    if (more_m2 < kAlike * kAlike * scale_m * scale_m * fewer) {
      Target target = f.feature;
      target.k = f.k[c.place];
      found.touches.push_back(target);
      found.off_m.push_back(c.without.off_m);
    }
  }
  return found;
}

}  // namespace

ResidualScale::ResidualScale(const Observations& o, const std::vector<ResidualsOfFeature>& all)
    : u_m_(root_sum_of_squares(o.plan.noise.probe_m, o.plan.noise.machine_m)) {
  std::map<Feature, std::vector<double>> kinds;
  std::map<std::string, std::vector<double>> features;
  std::map<Feature, std::size_t> degrees_of_freedom;
  for (const ResidualsOfFeature& f : all) {
    if (f.degrees_of_freedom > 0) {
      kinds[f.feature.feature].push_back(f.sigma_m());
      features[feature_name(f.feature)].push_back(f.sigma_m());
      std::size_t& most = degrees_of_freedom[f.feature.feature];
      most = std::max(most, f.degrees_of_freedom);
    }
  }

  for (const auto& [kind, sigma_m] : kinds) {
    of_kind_m_[kind] = typical_sigma_m(sigma_m, degrees_of_freedom[kind]);
  }
  constexpr std::size_t kFewestPasses = 3;
  for (const ResidualsOfFeature& f : all) {
    const std::vector<double>& sigma_m = features[feature_name(f.feature)];
    if (sigma_m.size() >= kFewestPasses) {
      of_feature_m_[feature_name(f.feature)] =
          typical_sigma_m(sigma_m, degrees_of_freedom[f.feature.feature]);
    }
  }
}

double ResidualScale::of(const Target& feature) const {
  double scale_m = u_m_;
  if (const auto kind = of_kind_m_.find(feature.feature); kind != of_kind_m_.end()) {
    scale_m = std::max(scale_m, kind->second);
  }
  if (const auto same = of_feature_m_.find(feature_name(feature)); same != of_feature_m_.end()) {
    scale_m = std::max(scale_m, same->second);
  }
  return scale_m;
}

std::string name_in_plan(const Plan& plan, std::size_t measurement, const Target& target) {
  return message(plan.measurements[measurement].name, ": ", feature_name(target));
}

std::optional<Suspects> suspects(const Observations& o, const std::vector<ResidualsOfFeature>& all,
                                 const SetAsideOptions& options, std::vector<std::string>& left) {
  const ResidualScale scale(o, all);
  const ResidualsOfFeature* worst = nullptr;
  double worst_ratio = options.limit;
  for (const ResidualsOfFeature& f : all) {
    const double ratio = f.sigma_m() / scale.of(f.feature);
    if (ratio <= worst_ratio) {
      continue;
    }
    const std::string feature = name_in_plan(o.plan, f.measurement, f.feature);
    if (std::find(left.begin(), left.end(), feature) != left.end()) {
      continue;
    }
    if (!keeps_enough(f, o.bar.pattern)) {
      left.push_back(feature);
      continue;
    }
    worst_ratio = ratio;
    worst = &f;
  }
  if (worst == nullptr) {
    return std::nullopt;
  }

  const auto pass = std::find_if(o.passes.begin(), o.passes.end(), [&](const PassObservation& p) {
    return p.measurement == worst->measurement;
  });
  Suspects found =
      suspects_in(*worst, o.positions[pass->position].pose.axes, scale.of(worst->feature));
  if (found.touches.empty()) {
    left.push_back(name_in_plan(o.plan, worst->measurement, worst->feature));
    return suspects(o, all, options, left);
  }
  return found;
}

std::size_t worst_suspect(const Observations& o, const std::vector<PassTouches>& touches,
                          const Suspects& suspects, const Options& options) {
  if (suspects.touches.size() == 1) {
    return 0;
  }
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < suspects.touches.size(); ++i) {
    PassTouches without = touches[suspects.measurement];
    set_aside(without, suspects.touches[i]);
    Observations changed = o;
    NominalBar nominal(o.bar, o.plan.tip_radius_m);
    const auto pass = std::find_if(
        changed.passes.begin(), changed.passes.end(),
        [&](const PassObservation& p) { return p.measurement == suspects.measurement; });
    if (!observe_pass(changed, *pass, without, nominal, options.limits, false)) {
      continue;
    }
    const Result<double> chi2 = whole_chi2(changed, nuisance_options(options.solve));
    if (chi2 && *chi2 < least) {
      least = *chi2;
      best = i;
    }
  }
  return best;
}

std::size_t farthest_suspect(const Observations& o, const std::vector<BarPose>& poses,
                             const std::vector<ResidualsOfFeature>& all, const Suspects& suspects) {
  const PlanesInBar planes(o, poses, all);
  std::size_t farthest = 0;
  double most_m = -1.0;
  for (std::size_t i = 0; i < suspects.touches.size(); ++i) {
    const double off_m = std::abs(planes.off_m(suspects.measurement, suspects.touches[i]));
    if (off_m > most_m) {
      most_m = off_m;
      farthest = i;
    }
  }
  return farthest;
}

void set_aside(PassTouches& touches, const Target& target) {
  for (Touch& touch : touches) {
    if (touch.target == target) {
      touch.set_aside = true;
    }
  }
}

}  // namespace abbe::calib::mfb
