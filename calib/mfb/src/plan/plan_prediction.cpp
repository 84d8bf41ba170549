#include "abbe/calib/mfb/plan/plan_prediction.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "abbe/result/try.hpp"
#include "observe/observations.hpp"

namespace abbe::calib::mfb {
namespace {

ErrorUncertainty uncertainty_of(std::string name, bool is_angle, const Eigen::VectorXd& variance,
                                Eigen::Index first, Eigen::Index count) {
  ErrorUncertainty error{.name = std::move(name), .is_angle = is_angle};
  Eigen::Index free = 0;
  double sum = 0.0;
  for (Eigen::Index i = first; i < first + count; ++i) {
    if (variance(i) > 0.0) {
      sum += variance(i);
      ++free;
    }
  }
  error.rms_u = std::sqrt(sum / static_cast<double>(std::max<Eigen::Index>(free, 1)));
  error.max_u = std::sqrt(std::max(0.0, variance.segment(first, count).maxCoeff()));
  return error;
}

std::vector<ErrorUncertainty> uncertainties(const ParameterLayout& layout,
                                            const Eigen::VectorXd& variance) {
  std::vector<ErrorUncertainty> errors;
  for (const Table& table : layout.tables()) {
    errors.push_back(
        uncertainty_of(calib::name(table.motion), is_rotation(table.motion.motion), variance,
                       static_cast<Eigen::Index>(table.offset),
                       static_cast<Eigen::Index>(layout.node_count(table.motion.axis))));
  }
  auto parameter = static_cast<Eigen::Index>(layout.squareness_offset());
  for (const std::string_view squareness : kSquarenessNames) {
    errors.push_back(uncertainty_of(std::string(squareness), true, variance, parameter++, 1));
  }
  return errors;
}

/// The passes of each position of a plan, in the order of time.
std::vector<std::vector<Measurement>> by_position(const Plan& plan) {
  std::vector<std::vector<Measurement>> positions;
  for (const Measurement& m : plan.measurements) {
    const auto at = std::find_if(positions.begin(), positions.end(), [&](const auto& passes) {
      return passes.front().position == m.position;
    });
    (at == positions.end() ? positions.emplace_back() : *at).push_back(m);
  }
  return positions;
}

}  // namespace

struct PlanPredictor::Parts {
  Bar bar;
  Plan plan;
  MfbMachine machine;
  SolveOptions options;
  Observations empty;  ///< without passes
  SharedUnknowns shared;
};

PlanPredictor::PlanPredictor(std::unique_ptr<const Parts> parts) : parts_(std::move(parts)) {}
PlanPredictor::PlanPredictor(PlanPredictor&&) noexcept = default;
PlanPredictor& PlanPredictor::operator=(PlanPredictor&&) noexcept = default;
PlanPredictor::~PlanPredictor() = default;

Eigen::VectorXd PlanPrediction::u() const {
  return covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
}

Result<PlanPredictor> PlanPredictor::of(const Bar& bar, const Plan& plan, const MfbMachine& machine,
                                        const SolveOptions& options) {
  Plan none = plan;
  Measurement anywhere;
  anywhere.name = anywhere.position = "any";
  anywhere.temperature_K = kReferenceTemperature_K;
  none.measurements = {anywhere};
  return observations_of_plan(bar, none, machine).map([&](Observations o) {
    none.measurements.clear();
    SharedUnknowns shared(o);
    return PlanPredictor(std::make_unique<const Parts>(
        Parts{bar, std::move(none), machine, options, std::move(o), std::move(shared)}));
  });
}

Result<PositionInformation> PlanPredictor::position(std::span<const Measurement> passes) const {
  Plan plan = parts_->plan;
  plan.measurements.assign(passes.begin(), passes.end());
  const Result<Observations> o = planned_observations(parts_->bar, plan, parts_->machine);
  ABBE_TRY(o);
  if (o->positions.size() != 1) {
    return failure(ErrorCode::BadInput, message("prediction of a position: the passes are of ",
                                                o->positions.size(), " positions"));
  }

  return position_system(*o, 0, parts_->shared, nuisance_options(parts_->options))
      .map([&](PositionSystem system) {
        return PositionInformation{o->positions.front().name, std::move(system.E),
                                   static_cast<std::size_t>(system.y.size()),
                                   static_cast<std::size_t>(system.layout.size)};
      });
}

PlanPrediction PlanPredictor::predict(std::span<const PositionInformation* const> positions) const {
  const SharedUnknowns& shared = parts_->shared;
  PlanPrediction prediction;
  prediction.unknowns = static_cast<std::size_t>(shared.size());
  estimation::Information data(prediction.unknowns);
  add_shared_priors(data, shared);
  for (const PositionInformation* position : positions) {
    data.add_rows(position->rows, Eigen::VectorXd::Zero(position->rows.rows()));
    prediction.observations += position->observations;
    prediction.unknowns += position->nuisances;
  }

  const SharedEstimate estimate = estimate_of(std::move(data), shared);
  const Eigen::Index n = shared.parameters();
  const Eigen::MatrixXd half = shared.expanded(estimate.covariance.topLeftCorner(n, n));
  prediction.covariance = shared.expanded(half.transpose());
  prediction.rank = prediction.unknowns - estimate.defect;
  prediction.condition = estimate.condition;
  prediction.errors = uncertainties(parts_->empty.basis.layout(), prediction.covariance.diagonal());
  for (const ErrorUncertainty& error : prediction.errors) {
    const SolveOptions& options = parts_->options;
    const double ratio = error.max_u / (error.is_angle ? options.most_u_rad : options.most_u_m);
    prediction.worst = std::max(prediction.worst, ratio);
    if (!(ratio <= 1.0)) {
      prediction.not_seen.push_back(error.name);
    }
  }
  return prediction;
}

Result<PlanPrediction> predict(const Bar& bar, const Plan& plan, const MfbMachine& machine,
                               const SolveOptions& options) {
  if (Result<void> valid = check(bar).and_then([&] { return check(plan, bar); }); !valid) {
    return tl::unexpected(valid.error());
  }
  const Result<PlanPredictor> predictor = PlanPredictor::of(bar, plan, machine, options);
  ABBE_TRY(predictor);

  std::vector<PositionInformation> positions;
  for (const std::vector<Measurement>& passes : by_position(plan)) {
    Result<PositionInformation> position = predictor->position(passes);
    ABBE_TRY(position);
    positions.push_back(*std::move(position));
  }
  std::vector<const PositionInformation*> all;
  for (const PositionInformation& position : positions) {
    all.push_back(&position);
  }
  return predictor->predict(all);
}

}  // namespace abbe::calib::mfb
