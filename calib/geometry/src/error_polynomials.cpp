#include "abbe/calib/geometry/error_polynomials.hpp"

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {
namespace {

char small_letter(std::size_t axis) {
  return static_cast<char>('x' + static_cast<char>(axis));
}

/// Sign of e_a x e_b = +- e_c, e: unit vectors of the axes, c: the axis other than a and b; a != b.
double handedness(std::size_t a, std::size_t b) {
  return (a + 1) % 3 == b ? 1.0 : -1.0;
}

/// Collects names and terms coefficient by coefficient.
struct Builder {
  const KinematicChain& chain;
  Vector3 tool_mm;
  std::vector<std::string> names{};
  std::vector<PolynomialTerm> terms{};

  void add(std::size_t component, const Monomial& m, double factor) {
    if (factor != 0.0) {
      terms.push_back({component, names.size() - 1, m, factor});
    }
  }

  /// Adds the terms of a rotation about e_direction (e: unit vectors) with the magnitude `m`:
  ///     m e_direction x (sum of q_b e_b over the axes b at `first_place` and nearer to the tool
  ///                      + tool offset)
  void add_rotation(std::size_t direction, std::size_t first_place, const Monomial& m) {
    for (std::size_t b = 0; b < 3; ++b) {
      if (b == direction) {
        continue;
      }
      const std::size_t component = 3 - direction - b;
      const double sign = handedness(direction, b);
      if (chain.place(kAllAxes[b]) >= first_place) {
        Monomial with_arm = m;
        ++with_arm.exponent[b];
        add(component, with_arm, sign);
      }
      add(component, m, sign * tool_mm(static_cast<Eigen::Index>(b)));
    }
  }

  void add_error_function(Axis axis, bool rotation, std::size_t direction, int order) {
    for (int k = order; k >= 0; --k) {
      names.push_back(message("k_", rotation ? 'e' : 'd', small_letter(direction),
                              small_letter(index(axis)), k));
      Monomial m;
      m.exponent[index(axis)] = k;
      if (rotation) {
        add_rotation(direction, chain.place(axis) + 1, m);
      } else {
        add(direction, m, 1.0);
      }
    }
  }

  /// Squareness of the axes at two places of the chain: a rotation about the third axis, before the
  /// travel of the second.
  void add_squareness(std::size_t first_place, std::size_t second_place) {
    const std::size_t a = index(chain.order_w_to_t()[first_place]);
    const std::size_t b = index(chain.order_w_to_t()[second_place]);
    names.push_back(message("S_", small_letter(a), small_letter(b)));
    add_rotation(3 - a - b, second_place, Monomial{});
  }
};

}  // namespace

double Monomial::at(const Vector3& p_mm) const {
  double value = 1.0;
  for (std::size_t a = 0; a < 3; ++a) {
    for (int k = 0; k < exponent[a]; ++k) {
      value *= p_mm(static_cast<Eigen::Index>(a));
    }
  }
  return value;
}

Result<ErrorPolynomials> ErrorPolynomials::of(const KinematicChain& chain, int order,
                                              const Vector3& tool_offset_mm) {
  if (order < kLeastOrder || order > kMostOrder) {
    return failure(ErrorCode::BadInput, message("error polynomials: order ", order, ", must be ",
                                                kLeastOrder, " to ", kMostOrder));
  }

  if (!tool_offset_mm.allFinite()) {
    return failure(ErrorCode::NotFinite, "error polynomials: the tool offset is not a number");
  }

  Builder build{chain, tool_offset_mm};
  for (const Axis axis : kAllAxes) {
    for (const bool rotation : {false, true}) {
      for (std::size_t direction = 0; direction < 3; ++direction) {
        build.add_error_function(axis, rotation, direction, order);
      }
    }
  }

  build.add_squareness(0, 1);
  build.add_squareness(1, 2);
  build.add_squareness(0, 2);
  ErrorPolynomials result;
  result.names_ = std::move(build.names);
  result.terms_ = std::move(build.terms);

  return result;
}

Eigen::Matrix3Xd ErrorPolynomials::A(const Vector3& p_mm) const {
  Eigen::Matrix3Xd A = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(names_.size()));
  for (const PolynomialTerm& t : terms_) {
    A(static_cast<Eigen::Index>(t.component), static_cast<Eigen::Index>(t.coefficient)) +=
        t.factor * t.monomial.at(p_mm);
  }
  return A;
}

}  // namespace abbe::calib
