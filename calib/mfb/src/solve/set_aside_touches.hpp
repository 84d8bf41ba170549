#pragma once
/// Searches touches to be excluded (identify.hpp).

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "solve/feature_residuals.hpp"

namespace abbe::calib::mfb {

/// The noise with which the residuals of a feature are compared. It is the largest of: the noise of
/// a touch, the median over the features of its kind, and the scatter of the same feature in all
/// passes (form errors of the bar are the same in every pass).
class ResidualScale {
 public:
  ResidualScale(const Observations&, const std::vector<ResidualsOfFeature>&);
  [[nodiscard]] double of(const Target& feature) const;

 private:
  double u_m_ = 0.0;
  std::map<Feature, double> of_kind_m_;
  std::map<std::string, double> of_feature_m_;
};

/// Touches of one feature, one of which is probably wrong.
struct Suspects {
  std::size_t measurement = 0;
  std::vector<Target> touches;  ///< the most probable first; more than one if they cannot be
                                ///< distinguished
  std::vector<double> off_m;    ///< distance of each touch from the feature fitted without it
};
/// The suspects in the feature with the largest residuals above the limit; nullopt if there is
/// none. Features in `left` are not considered. A feature that would keep too few touches is added
/// to `left`.
[[nodiscard]] std::optional<Suspects> suspects(const Observations&,
                                               const std::vector<ResidualsOfFeature>&,
                                               const SetAsideOptions&,
                                               std::vector<std::string>& left);

/// Index of the suspect without which the chi-square of all passes is smallest; `touches` are those
/// of the plan.
[[nodiscard]] std::size_t worst_suspect(const Observations&,
                                        const std::vector<PassTouches>& touches, const Suspects&,
                                        const Options&);
/// Index of the suspect of a plane that is farthest from the places touched in the other passes,
/// along the normal, in bar axes. Chi-square cannot find it: four touches of a plane have equal
/// residuals, and O_i does not depend on the planes to first order. `poses`: by position.
[[nodiscard]] std::size_t farthest_suspect(const Observations&, const std::vector<BarPose>& poses,
                                           const std::vector<ResidualsOfFeature>&, const Suspects&);

/// Text such as "X2: hole 3".
[[nodiscard]] std::string name_in_plan(const Plan&, std::size_t measurement, const Target&);

void set_aside(PassTouches&, const Target&);

}  // namespace abbe::calib::mfb
