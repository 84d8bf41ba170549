#include "otf/about_bends.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "elementary.hpp"

namespace abbe::calib::otf {
namespace {

/// -2 log of the marginal likelihood, as a function of the size of the prior, without constants. In
/// the eigenvectors of the information, one term for each:
///     log(1 + s^2 l) - s^2 c^2 / (1 + s^2 l),   l: eigenvalue, c: component of g
class Likelihood {
 public:
  Likelihood(const AboutBends& about, const Smoothness& s) {
    std::vector<Eigen::Index> kept, out;
    for (std::size_t i = 0; i < about.bends.size(); ++i) {
      (is_left_out(s, about.bends[i]) ? out : kept).push_back(static_cast<Eigen::Index>(i));
    }
    Eigen::MatrixXd H = about.H(kept, kept);
    Eigen::VectorXd g = about.g(kept);
    if (!out.empty()) {
      const auto of_out = Eigen::MatrixXd(about.H(out, out)).completeOrthogonalDecomposition();
      const Eigen::MatrixXd across = about.H(kept, out);
      H -= across * of_out.solve(across.transpose());
      g -= across * of_out.solve(Eigen::VectorXd(about.g(out)));
    }

    Eigen::VectorXd sigma(g.size());
    for (Eigen::Index i = 0; i < g.size(); ++i) {
      sigma(i) =
          about.bends[static_cast<std::size_t>(kept[static_cast<std::size_t>(i)])].sigma_of_unit;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        sigma.asDiagonal() * H * sigma.asDiagonal() / about.variance_factor);
    l_ = eigen.eigenvalues().cwiseMax(0.0);
    c2_ = (eigen.eigenvectors().transpose() * sigma.cwiseProduct(g) / about.variance_factor)
              .cwiseAbs2();
  }

  [[nodiscard]] double at(double bend_m) const {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < l_.size(); ++i) {
      const double s2 = bend_m * bend_m, one = 1.0 + s2 * l_(i);
      sum += natural_logarithm(one) - s2 * c2_(i) / one;
    }
    return sum;
  }

 private:
  Eigen::VectorXd l_, c2_;
};

/// The same bend, or one of other nodes at the same place. Neighbours of the same table only touch.
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

AboutBends about_bends(const estimation::Information& data, const estimation::TableBasis& basis,
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
  Eigen::VectorXd sigma(n), prior(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const TableBend& bend = about.bends[static_cast<std::size_t>(i)];
    const bool out = is_left_out(s, bend);
    sigma(i) = out ? bend.sigma_of_unit * kLargestBend_m : sigma_of(s, bend);
    // A bend that data do not determine has no other information.
    constexpr double kAlmostNoPrior = 1e-8;
    prior(i) = out ? kAlmostNoPrior : 1.0;
  }

  Eigen::MatrixXd K = sigma.asDiagonal() * about.H * sigma.asDiagonal() / about.variance_factor;
  K.diagonal() += prior;
  const Eigen::LLT<Eigen::MatrixXd> factor(K);
  const Eigen::VectorXd g = sigma.cwiseProduct(about.g) / about.variance_factor;
  return {factor.solve(g), factor.solve(Eigen::MatrixXd::Identity(n, n))};
}

double most_likely_bend_m(const AboutBends& about, const Smoothness& s) {
  constexpr double kStep = 1.0292;  // 80 steps per factor of ten
  const Likelihood likelihood(about, s);
  double best_m = kLargestBend_m, least = likelihood.at(best_m);
  for (double bend_m = kLargestBend_m; bend_m >= kSmallestBend_m; bend_m /= kStep) {
    if (const double value = likelihood.at(bend_m); value < least) {
      least = value;
      best_m = bend_m;
    }
  }
  return best_m;
}

}  // namespace abbe::calib::otf
