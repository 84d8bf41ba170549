#include "abbe/calib/otf/identify.hpp"

namespace abbe::calib::otf {

Result<Identification> identify(std::span<const TrackerObservation> samples, const Machine& machine,
                                const Path& path, const Noise& noise, const Options& options) {
  Result<Observations> observations = observe(samples, machine, path, noise, options);
  if (!observations) {
    return tl::unexpected(observations.error());
  }
  Result<Solution> solution = solve(*observations, options);
  if (!solution) {
    return tl::unexpected(solution.error());
  }
  return Identification{*std::move(observations), *std::move(solution)};
}

}  // namespace abbe::calib::otf
