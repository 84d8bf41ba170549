#include "abbe/calib/internal/otf/run/about_bends.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace abbe::calib::otf {
namespace {

/// True if `bend` is the bend `sharp`, or one of other nodes at the same place. Neighbouring bends
/// of a table share nodes but are not the same.
bool is_at(const Bend& sharp, const TableBend& bend) {
  constexpr double kSame_m = 1e-9;  // rounding of nodes at the same place
  const auto is_inside = [](double x_m, const auto& b) {
    return b.from_m + kSame_m < x_m && x_m < b.to_m - kSame_m;
  };
  return sharp.motion == bend.motion &&
         (is_inside(bend.position_m, sharp) || is_inside(sharp.position_m, bend));
}

}  // namespace

bool is_left_out(const Smoothness& s, const TableBend& bend) {
  return s.bend_m[index(bend.motion.axis)] <= 0.0 ||
         std::find(s.rough_tables.begin(), s.rough_tables.end(), bend.motion) !=
             s.rough_tables.end() ||
         std::any_of(s.sharp.begin(), s.sharp.end(), [&](const Bend& b) { return is_at(b, bend); });
}

double sigma_of(const Smoothness& s, const TableBend& bend) {
  return s.bend_m[index(bend.motion.axis)] * bend.sigma_of_unit;
}

AboutBends about_bends(const estimation::Information& data, const TableBasis& basis,
                       double variance_factor) {
  AboutBends about{bends_of(basis.layout()), {}, {}, variance_factor};
  const auto n = static_cast<Eigen::Index>(data.unknowns());
  const BendCoordinates c = bend_coordinates(about.bends, n);

  estimation::Information in_coordinates(static_cast<std::size_t>(n));
  in_coordinates.add_rows(data.R() * c.U_of, data.z());
  const estimation::Information of_bends = in_coordinates.without_unknowns(c.others);
  const Eigen::MatrixXd R = of_bends.R();
  about.H = R.transpose() * R;
  about.g = R.transpose() * of_bends.z();
  return about;
}

BendPosterior posterior_of(const AboutBends& about, const Smoothness& s) {
  const Eigen::Index n = about.g.size();
  constexpr double kUnit_m = 100e-6;  // unit of a bend to which the prior is not applied
  Eigen::VectorXd sigma(n), prior(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const TableBend& bend = about.bends[static_cast<std::size_t>(i)];
    const bool out = is_left_out(s, bend);
    sigma(i) = out ? bend.sigma_of_unit * kUnit_m : sigma_of(s, bend);
    // A very wide prior for bends that are left out; it only matters for bends that the data do not
    // determine.
    constexpr double kAlmostNoPrior = 1e-8;
    prior(i) = out ? kAlmostNoPrior : 1.0;
  }

  Eigen::MatrixXd K = sigma.asDiagonal() * about.H * sigma.asDiagonal() / about.variance_factor;
  K.diagonal() += prior;
  const Eigen::LLT<Eigen::MatrixXd> factor(K);
  const Eigen::VectorXd g = sigma.cwiseProduct(about.g) / about.variance_factor;
  return {factor.solve(g), factor.solve(Eigen::MatrixXd::Identity(n, n))};
}

}  // namespace abbe::calib::otf
