#pragma once
/// Search of touches to be excluded (identify.hpp).

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "solve/feature_residuals.hpp"

namespace abbe::calib::mfb {

/// The noise that the residuals of a feature are compared with: that of a touch, the median of the
/// features of its kind, or that of the same feature in all passes, whichever is largest. Form
/// errors of the bar are the same in every pass.
class ResidualScale {
 public:
  ResidualScale(const Observations&, const std::vector<ResidualsOfFeature>&);
  [[nodiscard]] double of(const Target& feature) const;

 private:
  double u_m_ = 0.0;
  std::map<Feature, double> of_kind_m_;
  std::map<std::string, double> of_feature_m_;
};

/// Touches, of which one is probably wrong.
struct Suspects {
  std::size_t measurement = 0;
  std::vector<Target> touches;  ///< the most probable first; more than one if they look alike
  std::vector<double> off_m;    ///< of each touch from the feature without it
};
/// Of the feature with the largest residuals above the limit; nullopt if there is none. Features in
/// `left` are not considered. A feature that would have too few touches goes into `left`.
[[nodiscard]] std::optional<Suspects> suspects(const Observations&,
                                               const std::vector<ResidualsOfFeature>&,
                                               const SetAsideOptions&,
                                               std::vector<std::string>& left);

/// The suspect without which the chi-square of all passes is smallest; `touches` are those of the
/// plan.
[[nodiscard]] std::size_t worst_suspect(const Observations&,
                                        const std::vector<PassTouches>& touches, const Suspects&,
                                        const Options&);
/// The suspect of a plane that is farthest from where the other passes touched the bar, along the
/// normal, in the axes of the bar. (Four touches of a plane have equal residuals, and O_i does not
/// depend on the planes to first order: chi-square does not show which one is wrong.) `poses`: by
/// position.
[[nodiscard]] std::size_t farthest_suspect(const Observations&, const std::vector<BarPose>& poses,
                                           const std::vector<ResidualsOfFeature>&, const Suspects&);

/// "X2: hole 3".
[[nodiscard]] std::string name_in_plan(const Plan&, std::size_t measurement, const Target&);

void set_aside(PassTouches&, const Target&);

}  // namespace abbe::calib::mfb
