#include "abbe/calib/geometry/scaled_design.hpp"

#include <algorithm>
#include <map>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"
#include "function_value.hpp"

namespace abbe::calib {
namespace {

using Coefficients = std::array<double, kMostOrder + 1>;  ///< coefficients of 1, q, q^2 ...

std::size_t axis_of(const EquivalentModel& model, std::size_t row) {
  Eigen::Index coefficient = 0;
  model.W().row(static_cast<Eigen::Index>(row)).cwiseAbs().maxCoeff(&coefficient);
  return static_cast<std::size_t>(coefficient) / (6 * static_cast<std::size_t>(model.order() + 1));
}

DesignFunction function_of(const EquivalentModel& model, std::size_t row) {
  const std::span<const PolynomialShare> shares = model.shares(row);
  const std::array<int, 3>& e = shares.front().monomial.exponent;
  const auto axes =
      static_cast<std::size_t>(std::count_if(e.begin(), e.end(), [](int k) { return k > 0; }));
  DesignFunction f;
  f.parts = shares.size();

  if (axes == 1) {
    f.kind = FunctionKind::Translation;
    f.axis = static_cast<std::size_t>(
        std::find_if(e.begin(), e.end(), [](int k) { return k > 0; }) - e.begin());
  } else if (axes == 2) {
    f.kind = FunctionKind::Rotation;
    f.axis = axis_of(model, row);
  }

  f.order = e[f.axis];
  for (std::size_t p = 0; p < f.parts; ++p) {
    f.part[p] = {shares[p].component, shares[p].factor, 3};
    for (std::size_t b = 0; b < 3; ++b) {
      if (b != f.axis && shares[p].monomial.exponent[b] > 0) {
        f.part[p].arm = b;
      }
    }
  }

  return f;
}

/// P_order((q - centre) / half_width) as a polynomial in q.
Coefficients legendre_in(double centre, double half_width, int order) {
  const auto times_u = [&](const Coefficients& p) {
    Coefficients r{};
    for (std::size_t k = 0; k < p.size(); ++k) {
      r[k] -= p[k] * centre / half_width;
      if (k + 1 < p.size()) {
        r[k + 1] += p[k] / half_width;
      }
    }
    return r;
  };

  Coefficients before{}, current{};
  current[0] = 1.0;
  for (int n = 0; n < order; ++n) {
    Coefficients next = times_u(current);
    for (std::size_t k = 0; k < next.size(); ++k) {
      next[k] = ((2 * n + 1) * next[k] - n * before[k]) / (n + 1);
    }
    before = current;
    current = next;
  }

  return current;
}

}  // namespace

ReadingBox bounding_box(std::span<const Vector3> readings_m) {
  Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Vector3& p : readings_m) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return {0.5 * (low + high), 0.5 * (high - low)};
}

Result<ScaledDesign> ScaledDesign::of(const KinematicChain& chain, int order,
                                      const ReadingBox& box) {
  if (!box.centre_m.allFinite() || !box.half_width_m.allFinite()) {
    return failure(ErrorCode::NotFinite, "scaled design: the box of readings is not finite");
  }

  // Readings within a travel of a micrometre do not determine polynomials along an axis.
  constexpr double kLeastHalfWidth_m = 1e-6;
  if (box.half_width_m.minCoeff() < kLeastHalfWidth_m) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("scaled design: the readings have half widths ",
                           box.half_width_m.transpose(), " m: at least one axis does not move"));
  }

  Result<EquivalentModel> equivalent = EquivalentModel::of(chain, order);
  ABBE_TRY(equivalent);

  ScaledDesign design;
  design.box_ = box;
  for (std::size_t j = 0; j < equivalent->size(); ++j) {
    design.functions_.push_back(function_of(*equivalent, j));
  }

  design.equivalent_ = *std::move(equivalent);
  return design;
}

ScaledDesign::Factors ScaledDesign::factors(const Vector3& reading_m) const {
  Factors at;
  const Vector3 from_centre_m = reading_m - box_.centre_m;
  const double arm_unit = arm_unit_m();

  for (std::size_t a = 0; a < 3; ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    const double u = from_centre_m(i) / box_.half_width_m(i);
    std::array<double, kMostOrder + 1>& P = at.P[a];
    P[0] = 1.0;
    P[1] = u;
    for (std::size_t k = 1; k < kMostOrder; ++k) {
      const auto n = static_cast<double>(k);
      P[k + 1] = ((2.0 * n + 1.0) * u * P[k] - n * P[k - 1]) / (n + 1.0);
    }
    at.arm[a] = from_centre_m(i) / arm_unit;
  }

  at.arm[3] = 1.0;
  return at;
}

Eigen::Matrix3Xd ScaledDesign::B(const Vector3& reading_m) const {
  const Factors at = factors(reading_m);
  Eigen::Matrix3Xd B(3, static_cast<Eigen::Index>(size()));
  for (std::size_t j = 0; j < size(); ++j) {
    B.col(static_cast<Eigen::Index>(j)) = function_value(functions_[j], at);
  }
  return B;
}

Eigen::MatrixXd ScaledDesign::named_from_scaled() const {
  // A named coefficient with two monomials (a rotation with two arms) is the mean of the values
  // that its two monomials give.
  struct Target {
    Eigen::Index row;
    double per_factor;
  };

  std::map<std::pair<std::size_t, Monomial>, Target> targets;
  for (std::size_t j = 0; j < size(); ++j) {
    const auto shares = equivalent_.shares(j);
    for (const PolynomialShare& s : shares) {
      targets[{s.component, s.monomial}] = {static_cast<Eigen::Index>(j),
                                            1.0 / (s.factor * static_cast<double>(shares.size()))};
    }
  }

  const auto n = static_cast<Eigen::Index>(size());
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  const Vector3 centre_mm = kMmPerM * box_.centre_m, half_width_mm = kMmPerM * box_.half_width_m;

  for (std::size_t j = 0; j < size(); ++j) {
    const DesignFunction& f = functions_[j];
    const auto axis = static_cast<Eigen::Index>(f.axis);
    const Coefficients along = legendre_in(centre_mm(axis), half_width_mm(axis), f.order);
    for (std::size_t p = 0; p < f.parts; ++p) {
      const DesignFunction::Part& part = f.part[p];
      const bool with_arm = part.arm < 3;
      for (int k = 0; k <= f.order; ++k) {
        for (int arm_power = 0; arm_power <= (with_arm ? 1 : 0); ++arm_power) {
          Monomial m;
          m.exponent[f.axis] = k;
          double factor = part.sign * along[static_cast<std::size_t>(k)];
          if (with_arm) {
            m.exponent[part.arm] += arm_power;
            factor *= (arm_power == 1 ? 1.0 : -centre_mm(static_cast<Eigen::Index>(part.arm))) /
                      (kMmPerM * arm_unit_m());
          }
          if (factor != 0.0) {
            const Target& t = targets.at({part.component, m});
            M(t.row, static_cast<Eigen::Index>(j)) += factor * t.per_factor;
          }
        }
      }
    }
  }

  return M;
}

Eigen::MatrixX3d ScaledDesign::rotation_about(const Vector3& about_m) const {
  // omega x (q - about) = L(q) omega, L affine in q. The coefficients of constant functions follow
  // from L at the centre of the box, those of linear functions from the slope of L along each axis.
  const Matrix3 at_centre = rotation_effect(box_.centre_m - about_m);
  Eigen::MatrixX3d C = Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(size()), 3);
  for (std::size_t j = 0; j < size(); ++j) {
    const DesignFunction& f = functions_[j];
    const auto component = static_cast<Eigen::Index>(f.part[0].component);
    const auto axis = static_cast<Eigen::Index>(f.axis);
    const auto row = static_cast<Eigen::Index>(j);
    if (f.kind == FunctionKind::Constant) {
      C.row(row) = f.part[0].sign * at_centre.row(component);
    } else if (f.kind == FunctionKind::Translation && f.order == 1) {
      C.row(row) = f.part[0].sign * box_.half_width_m(axis) *
                   rotation_effect(Vector3::Unit(axis)).row(component);
    }
  }

  return C;
}

}  // namespace abbe::calib
