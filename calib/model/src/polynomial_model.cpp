#include "abbe/calib/model/polynomial_model.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/geometry/constant_fields.hpp"

namespace abbe::calib {
namespace {

/// Size of the arrays on the stack for the entries of all three components: at order 5 there are at
/// most 3 * 42.
constexpr std::size_t kMostEntries = 128;

std::string unit_of(const DesignFunction& f) {
  if (f.kind == FunctionKind::Rotation) {
    return f.order == 1 ? "rad/mm" : message("rad/mm^", f.order);
  }
  return f.order == 0 ? "mm" : (f.order == 1 ? "1" : message("mm^-", f.order - 1));
}

}  // namespace

Result<PolynomialModel> PolynomialModel::of(ScaledDesign design, const Vector3& ball1_m,
                                            Eigen::VectorXd c_m,
                                            const Eigen::MatrixXd& covariance_m2) {
  const auto n = static_cast<Eigen::Index>(design.size());
  if (c_m.size() != n || covariance_m2.rows() != n || covariance_m2.cols() != n) {
    return failure(
        ErrorCode::BadInput,
        message("evemu model: ", c_m.size(), " coefficients and a covariance of ",
                covariance_m2.rows(), " x ", covariance_m2.cols(), " for ", n, " functions"));
  }

  if (!c_m.allFinite() || !covariance_m2.allFinite() || !ball1_m.allFinite()) {
    return failure(ErrorCode::NotFinite, "evemu model: a coefficient is not a number");
  }

  if (!covariance_m2.isApprox(covariance_m2.transpose(), 1e-12) ||
      covariance_m2.diagonal().minCoeff() < 0) {
    return failure(ErrorCode::BadInput,
                   "evemu model: the covariance is not symmetric or has a negative variance");
  }

  PolynomialModel model(std::move(design));
  std::vector<Eigen::Index> column;
  for (std::size_t component = 0; component < 3; ++component) {
    model.first_[component] = model.entries_.size();
    for (std::size_t j = 0; j < model.design_.size(); ++j) {
      const DesignFunction& f = model.design_.functions()[j];
      for (std::size_t p = 0; p < f.parts; ++p) {
        if (f.part[p].component == component) {
          const auto at = static_cast<Eigen::Index>(j);
          model.entries_.push_back({f.part[p], f.axis, static_cast<std::size_t>(f.order), c_m(at)});
          column.push_back(at);
        }
      }
    }
  }

  model.first_[3] = model.entries_.size();
  if (model.entries_.size() > kMostEntries) {
    return failure(ErrorCode::BadInput, "evemu model: more functions than the highest order has");
  }

  model.entry_covariance_ = covariance_m2(column, column);
  model.ball1_m_ = ball1_m;
  model.c_m_ = std::move(c_m);
  model.covariance_m2_ = covariance_m2;

  return model;
}

Vector3 PolynomialModel::V_at(const Vector3& reading_m) const {
  const ScaledDesign::Factors at = design_.factors(reading_m);
  Vector3 V = Vector3::Zero();
  for (const Entry& e : entries_) {
    V(static_cast<Eigen::Index>(e.part.component)) +=
        e.c_m * e.part.sign * at.P[e.axis][e.order] * at.arm[e.part.arm];
  }
  return V;
}

void PolynomialModel::V_and_cov_at(const Vector3& reading_m, Vector3& V_m, Matrix3& cov_m2) const {
  const ScaledDesign::Factors at = design_.factors(reading_m);
  alignas(32) std::array<double, kMostEntries> b;
  V_m.setZero();

  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& e = entries_[i];
    b[i] = e.part.sign * at.P[e.axis][e.order] * at.arm[e.part.arm];
    V_m(static_cast<Eigen::Index>(e.part.component)) += b[i] * e.c_m;
  }

  // Covariance of the components c and d of V: b_c^T C_cd b_d, b_c: values of the entries of
  // component c, C: entry_covariance_. Every column of C is read once, from the first row of its
  // own component downwards.
  using Column = Eigen::Map<Eigen::VectorXd>;
  alignas(32) std::array<double, kMostEntries> sum;
  const std::size_t total = entries_.size();

  for (std::size_t d = 0; d < 3; ++d) {
    const std::size_t from = first_[d];
    const auto length = static_cast<Eigen::Index>(total - from);
    Column sums(sum.data(), length);
    sums.setZero();
    const double* column = entry_covariance_.data() + from * total + from;
    std::size_t j = from;

    for (; j + 1 < first_[d + 1]; j += 2, column += 2 * total) {
      sums += b[j] * Eigen::Map<const Eigen::VectorXd>(column, length) +
              b[j + 1] * Eigen::Map<const Eigen::VectorXd>(column + total, length);
    }

    if (j < first_[d + 1]) {
      sums += b[j] * Eigen::Map<const Eigen::VectorXd>(column, length);
    }

    for (std::size_t c = d; c < 3; ++c) {
      const auto count = static_cast<Eigen::Index>(first_[c + 1] - first_[c]);
      const double value = Eigen::Map<const Eigen::VectorXd>(sum.data() + (first_[c] - from), count)
                               .dot(Eigen::Map<const Eigen::VectorXd>(b.data() + first_[c], count));
      cov_m2(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(d)) = value;
      cov_m2(static_cast<Eigen::Index>(d), static_cast<Eigen::Index>(c)) = value;
    }
  }
}

std::vector<NamedCoefficient> PolynomialModel::named_coefficients() const {
  const Eigen::MatrixXd M = kMmPerM * design_.named_from_scaled();
  const Eigen::VectorXd value = M * c_m_;
  std::vector<NamedCoefficient> named;
  for (std::size_t j = 0; j < design_.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    const double variance = M.row(i) * covariance_m2_ * M.row(i).transpose();
    named.push_back({design_.equivalent().names()[j], value(i), std::sqrt(std::max(0.0, variance)),
                     unit_of(design_.functions()[j])});
  }
  return named;
}

Eigen::MatrixXd zero_at(const ScaledDesign& design, const Vector3& place_m) {
  const auto n = static_cast<Eigen::Index>(design.size());
  return Eigen::MatrixXd::Identity(n, n) - constant_fields(design) * design.B(place_m);
}

}  // namespace abbe::calib
