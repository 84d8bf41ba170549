#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/estimation/sparse_information.hpp"
#include "abbe/calib/otf/solve/solve.hpp"
#include "solve/datum_of.hpp"
#include "solve/priors.hpp"

namespace abbe::calib::otf {
namespace {

/// True if the weight of the row is 1/sigma^2, within rounding.
bool is_weighted_by_sigma(const Observation& o) {
  constexpr double kRounding = 1e-14;
  return std::abs(o.weight * o.sigma_m * o.sigma_m - 1.0) < kRounding;
}

}  // namespace

RowInformation& RowInformation::operator+=(const RowInformation& other) {
  if (noise || other.noise) {
    noise = noise.value_or(data);
    *noise += other.noise.value_or(other.data);
  }
  data += other.data;
  return *this;
}

RowInformation information_of(const Observations& o,
                              const std::function<bool(const Observation&)>& take) {
  std::vector<estimation::WeightedRow> rows, noise;
  rows.reserve(o.rows.size());
  bool weighted_by_sigma = true;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    if (!take || take(row)) {
      rows.push_back({o.A.row(i), row.y_m, std::sqrt(row.weight)});
      noise.push_back({o.A.row(i), 0.0, row.weight * row.sigma_m});
      weighted_by_sigma = weighted_by_sigma && is_weighted_by_sigma(row);
    }
  }

  RowInformation information(o.unknowns());
  information.data = estimation::information_of(o.unknowns(), rows);
  if (!weighted_by_sigma) {
    information.noise = estimation::information_of(o.unknowns(), noise);
  }
  return information;
}

estimation::Datum datum_of(const Observations& o) {
  return estimation::Datum(datum_conditions(ModelDatum::G2, o.basis, o.unknowns()));
}

std::size_t determined_by(const estimation::Information& data, const Eigen::MatrixXd& Q) {
  const Eigen::MatrixXd R = data.R();
  return static_cast<std::size_t>(std::lround((R * Q).cwiseProduct(R).sum()));
}

Result<Adjustment> adjust(const RowInformation& rows, const Observations& o, double datum_weight) {
  std::optional<estimation::Information> noise;
  if (rows.noise) {
    noise = with_priors(*rows.noise, o);
  }
  Result<Adjustment> a = datum_of(o).solve(with_priors(rows.data, o),
                                           {.weight = datum_weight,
                                            .noise = noise ? &*noise : nullptr,
                                            .label = [&](std::size_t i) { return o.label(i); }});
  if (a && o.smoothness) {
    a->rank = determined_by(rows.data, a->cofactor_Q);
  }
  return a;
}

}  // namespace abbe::calib::otf
