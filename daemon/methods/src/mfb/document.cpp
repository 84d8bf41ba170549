#include "abbe/methods/mfb/document.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "mfb/figures.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

/// Mean, rms and largest value of the components of vectors.
class FiguresOfVectors {
 public:
  void add(std::span<const calib::Vector3> vectors_m) {
    for (const calib::Vector3& v : vectors_m) {
      sum_m_ += v.cwiseAbs().sum();
      squares_m2_ += v.squaredNorm();
      largest_m_ = std::max(largest_m_, v.cwiseAbs().maxCoeff());
      count_ += 3.0;
    }
  }
  [[nodiscard]] ResidualFigures figures() const {
    if (count_ == 0.0) return {};
    return {sum_m_ / count_, std::sqrt(squares_m2_ / count_), largest_m_};
  }

 private:
  double sum_m_ = 0.0, squares_m2_ = 0.0, largest_m_ = 0.0, count_ = 0.0;
};

/// The figures of one member of the residuals, over all passes.
ResidualFigures figures_of(const mfb::Solution& solution,
                           std::vector<calib::Vector3> mfb::PassResiduals::*vectors_m) {
  FiguresOfVectors all;
  for (const mfb::PassResiduals& pass : solution.residuals) all.add(pass.*vectors_m);
  return all.figures();
}

std::size_t used_touches(const mfb::Observations& o) {
  std::size_t count = 0;
  for (const mfb::PassObservation& pass : o.passes) count += pass.touched.size();
  return count;
}

/// The value, or 0 if it is not finite, as for statistics without degrees of freedom.
double finite_or_zero(double value) {
  return std::isfinite(value) ? value : 0.0;
}

ModelStatistics bar_statistics(const MfbCandidate& candidate) {
  const mfb::Statistics& s = candidate.found.solution.statistics;
  return {.samples = used_touches(candidate.found.observations),
          .lost_samples = candidate.found.set_aside.size(),
          .observations = s.observations,
          .unknowns = s.unknowns,
          .rank = s.rank,
          .condition = finite_or_zero(s.condition),
          .sigma0 = finite_or_zero(s.sigma0),
          .chi2_per_dof = finite_or_zero(s.chi2_per_dof),
          .before = figures_of(candidate.found.solution, &mfb::PassResiduals::before_m),
          .after = figures_of(candidate.found.solution, &mfb::PassResiduals::O_m),
          .iterations = 1,
          .stop_reason = "direct",
          .degrees_of_freedom = s.degrees_of_freedom};
}

BarFigures bar_figures(const mfb::Identification& found) {
  BarFigures bar;
  for (const mfb::PassResiduals& pass : found.solution.residuals)
    bar.passes.push_back({pass.measurement, finite_or_zero(pass.degrees_of_freedom > 0.0
                                                               ? pass.chi2 / pass.degrees_of_freedom
                                                               : 0.0)});
  for (const mfb::PairDrift& pair : found.solution.drift)
    bar.drift.push_back({pair.forward, pair.backward, pair.rate_m, pair.u_rate_m});

  for (const mfb::SetAsideTouch& touch : found.set_aside) {
    const bool plane = touch.target.feature == mfb::Feature::Plane;
    const char* const side = touch.target.side == mfb::Side::Left ? "L" : "R";
    bar.set_aside.push_back({.measurement = touch.measurement_name,
                             .feature = std::string{name(touch.target.feature)},
                             .side = plane ? side : "",
                             .index = touch.target.index + 1,
                             .k = touch.target.k,
                             .residual_m = touch.residual_m});
  }
  return bar;
}

}  // namespace

std::string_view name(mfb::Feature feature) {
  switch (feature) {
    case mfb::Feature::Hole:
      break;
    case mfb::Feature::Rod:
      return "rod";
    case mfb::Feature::Plane:
      return "plane";
  }
  return "hole";
}

ModelDocument mfb_document(const MfbCandidate& candidate, mfb::Estimator estimator,
                           const Config& config, std::vector<InputFile> inputs,
                           protocol::UtcTime created) {
  ModelDocument document{
      candidate.found.model, "mfb",   std::string{mfb::name(estimator)}, config.machine.name,
      machine_hash(config),  created, bar_statistics(candidate),         std::move(inputs)};
  document.configuration = config.meaning;
  document.bar = bar_figures(candidate.found);
  document.run = mfb_figures(candidate);
  return document;
}

}  // namespace abbe::daemon
